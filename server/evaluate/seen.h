/* seen.h -- which pixels of a test view show surface that a training view sees.
 *
 * A view sees a point if it projects into the picture, is not occluded, and none of the four pixels of the bilinear
 * lookup straddles an edge: the four corners of each must hit one object without a depth discontinuity. Pixels on
 * edges mix surfaces, so surface that appears in no other pixel is not measured. Which side is seen does not matter.
 *
 * Deliberately shares no code with the reconstruction's own selection (views.h): the measure must not change with the
 * method. */
#ifndef UNBAKE_EVALUATE_SEEN_H
#define UNBAKE_EVALUATE_SEEN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/parallel.h"
#include "server/render/accel.h"
#include "server/scene/scene.h"

#define SEEN_SAMPLES 16 /* jittered rays per pixel */

struct seen {
    const struct scene *scene; /* borrowed, all three */
    const struct accel *accel;
    const bool *emits; /* [triangle_count] of the truth */
    size_t train_count;
    uint32_t *train;     /* [train_count] photographs; owned */
    uint8_t **straddles; /* [train_count][height * width] 1: the pixel lies on an edge; owned */
};

/* The mesh of the scene has object_id. */
void seen_init(struct seen *seen, const struct scene *scene, const struct accel *accel, const bool *emits,
               struct parallel *pool);
void seen_release(struct seen *seen);

/* flags[height * width] out: SCORE_PLAIN, SCORE_SEEN (score.h) of each pixel's samples. */
void seen_flags(const struct seen *seen, const struct camera *camera, struct parallel *pool, uint8_t *flags);

#endif
