/* seen.h -- which pixels of a test view show surface that some training view sees.
 *
 * A view sees a point when it projects into the picture, nothing lies between, and none of the
 * four pixels that a look-up there reads straddles a depth edge or two objects (views.h): what
 * such a pixel shows belongs to no surface, and surface that shows in no other is not measured.
 * From which side the surface is seen does not matter. */
#ifndef UNBAKE_EVALUATE_SEEN_H
#define UNBAKE_EVALUATE_SEEN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/parallel.h"
#include "server/reconstruct/views.h"

#define SEEN_SAMPLES 16 /* jittered rays per pixel */

struct seen {
    const struct views *views; /* by the objects of the truth */
    const bool *emits;         /* [triangle_count] of the truth */
};

/* flags[height * width] out: SCORE_PLAIN, SCORE_SEEN (score.h) of each pixel's samples. */
void seen_flags(const struct seen *seen, const struct camera *camera, struct parallel *pool,
                uint8_t *flags);

#endif
