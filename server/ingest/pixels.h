/* pixels.h -- where the pixels of a bundle's photographs go: memory and, beyond a budget, a file. */
#ifndef UNBAKE_INGEST_PIXELS_H
#define UNBAKE_INGEST_PIXELS_H

#include "common/spill.h"
#include "server/ingest/bundle.h"

/* For a program by itself: half of the memory that could be had, and a file in $TMPDIR, else in /var/tmp. The caller's
 * (spill_free). */
struct spill *pixels_new_temporary(void);

/* Has bundle_load use it, and half of its memory for decoding. */
void pixels_use(struct spill *spill, struct bundle_limits *limits);

#endif
