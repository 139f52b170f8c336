/* seen.h -- which pixels of a test view show surface that some training view sees. */
#ifndef UNBAKE_EVALUATE_SEEN_H
#define UNBAKE_EVALUATE_SEEN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/parallel.h"
#include "server/render/accel.h"
#include "server/scene/camera.h"
#include "server/scene/mesh.h"

#define SEEN_SAMPLES 16 /* jittered rays per pixel */

struct seen {
    const struct accel *accel;
    const struct mesh *mesh;
    const bool *emits;           /* [triangle_count] of the truth */
    const struct camera *train;  /* [train_count] */
    size_t train_count;
};

/* flags[height * width] out: SCORE_PLAIN, SCORE_SEEN (score.h) of each pixel's samples. A surface
 * point is seen by a camera when it projects into the picture and nothing lies between; from
 * which side does not matter. */
void seen_flags(const struct seen *seen, const struct camera *camera, struct parallel *pool,
                uint8_t *flags);

#endif
