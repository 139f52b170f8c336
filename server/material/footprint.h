/* footprint.h -- the piece of the atlas that a pixel of a photograph shows. */
#ifndef UNBAKE_MATERIAL_FOOTPRINT_H
#define UNBAKE_MATERIAL_FOOTPRINT_H

#include <stdbool.h>
#include <stddef.h>
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

/* The same of a triangle that is known to be what the pixel shows. */
bool footprint_of_triangle(struct footprint *f, const struct mesh *mesh, const struct atlas *atlas,
                           const struct camera *camera, uint32_t x, uint32_t y, uint32_t triangle);

/* The texels that make what a pixel shows, and their shares of it. One may be listed more than once. */
#define FOOTPRINT_SIDE 8 /* places a row and column of a footprint at which the texture is read, at most */
#define FOOTPRINT_TEXELS (4 * FOOTPRINT_SIDE * FOOTPRINT_SIDE)
struct footprint_texels {
    size_t count;
    uint32_t texel[FOOTPRINT_TEXELS];
    float share[FOOTPRINT_TEXELS]; /* they come to 1 */
};

/* As bilinear look-ups read them that stand a texel apart or, in large footprints, further. Of texels of `chart`, by
 * chart_of_texel[height][width]; returns the share that these have in the look-ups, 0 where there are none. */
float footprint_texels(struct footprint_texels *t, const struct footprint *f, uint32_t chart,
                       const uint32_t *chart_of_texel, uint32_t width, uint32_t height);

#endif
