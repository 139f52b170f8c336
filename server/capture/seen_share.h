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

#define SEEN_SHARE_POINTS 4096 /* of the surface, spread over its area; +25 %: no change */
/* By SEEN_SHARE_POINTS points. The same for any number of threads. */
struct seen_share seen_share_measure(const struct views *views, struct parallel *pool);

#define SEEN_SHARE_MIN 0.1 /* share of the surface; +25 %: no change */
/* STATUS_INPUT, with the likely reason, where nothing can be measured; and, unless `ignored`, less than
 * SEEN_SHARE_MIN of the surface. */
enum status seen_share_require(const struct seen_share *share, bool ignored, struct error *err);

#endif
