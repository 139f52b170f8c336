/* seen_share.h -- the share of the surface that photographs see: what can be measured at most. */
#ifndef UNBAKE_CAPTURE_SEEN_SHARE_H
#define UNBAKE_CAPTURE_SEEN_SHARE_H

#include "common/error.h"
#include "common/parallel.h"
#include "server/capture/views.h"

struct seen_share {
    double surface; /* share of the area that a training photograph sees from the front */
    double open;    /* share of the training photographs' pixels that meet no surface */
};

/* Looks at SEEN_SHARE_POINTS points, spread over the area. The same for any number of threads. */
#define SEEN_SHARE_POINTS 4096 /* +25 %: no change */
struct seen_share seen_share_measure(const struct views *views, struct parallel *pool);

/* STATUS_INPUT, with the likely reason, where nothing can be measured; and, unless `ignored`, less than
 * SEEN_SHARE_LEAST of the surface. */
#define SEEN_SHARE_LEAST 0.1 /* +25 %: no change */
enum status seen_share_require(const struct seen_share *share, bool ignored, struct error *err);

#endif
