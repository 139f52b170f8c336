/* pixels.h -- where the pixels of a bundle's photographs go: memory and, beyond a budget, a file. */
#ifndef UNBAKE_INGEST_PIXELS_H
#define UNBAKE_INGEST_PIXELS_H

#include "common/parallel.h"
#include "common/spill.h"
#include "server/ingest/bundle.h"

/* A file in `dir`; the pool keeps it within its budget. The caller's (pixels_free). */
struct spill *pixels_new(const char *dir, const struct spill_limits *limits, struct parallel *pool);

/* The same for a program by itself: half of the memory that could be had, and a file in $TMPDIR, else in /var/tmp. */
struct spill *pixels_new_temporary(struct parallel *pool);

/* After all that is taken of it was given back; NULL is fine. */
void pixels_free(struct spill *spill, struct parallel *pool);

/* Has bundle_load use it, and half of its memory for decoding. */
void pixels_use(struct spill *spill, struct bundle_limits *limits);

#endif
