/* footprint.h -- the piece of the atlas that a pixel of a photograph shows. */
#ifndef UNBAKE_RECONSTRUCT_FOOTPRINT_H
#define UNBAKE_RECONSTRUCT_FOOTPRINT_H

#include <stdbool.h>
#include <stdint.h>

#include "server/render/accel.h"
#include "server/scene/atlas.h"
#include "server/scene/camera.h"

/* The pixel shows the places middle + a * across + b * down of the atlas, texels, for a and b in [-1/2, 1/2]. */
struct footprint {
    uint32_t triangle;
    vec2 middle, across, down;
};

/* Of the surface that the middle of pixel (x, y) shows, as if all that the pixel shows were of that triangle's
 * plane. False where it shows none, or one seen nearly edge-on. */
bool footprint_find(struct footprint *f, const struct mesh *mesh, const struct atlas *atlas, const struct accel *accel,
                    const struct camera *camera, uint32_t x, uint32_t y);

#endif
