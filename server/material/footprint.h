/* footprint.h -- the footprint of a photograph's pixel in the atlas. */
#ifndef UNBAKE_MATERIAL_FOOTPRINT_H
#define UNBAKE_MATERIAL_FOOTPRINT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "server/render/accel.h"
#include "server/scene/atlas.h"
#include "server/scene/camera.h"

/* The parallelogram middle + a * across + b * down, texels of the atlas, a and b in [-1/2, 1/2]. */
struct footprint {
    uint32_t triangle;
    vec2 middle, across, down;
};

/* Footprint of pixel (x, y) in the plane of the triangle that its centre shows. False where it shows none, or one
 * nearly edge-on. */
bool footprint_find(struct footprint *f, const struct mesh *mesh, const struct atlas *atlas, const struct accel *accel,
                    const struct camera *camera, uint32_t x, uint32_t y);

/* The same for a given triangle. */
bool footprint_of_triangle(struct footprint *f, const struct mesh *mesh, const struct atlas *atlas,
                           const struct camera *camera, uint32_t x, uint32_t y, uint32_t triangle);

/* Texels that a pixel averages, and their weights. A texel may be listed more than once. */
/* Look-ups along each side of a footprint, at most; bounds time and memory; +25 %: no change. */
#define FOOTPRINT_SIDE 8
#define FOOTPRINT_TEXELS (4 * FOOTPRINT_SIDE * FOOTPRINT_SIDE) /* +25 %: no change */
struct footprint_texels {
    size_t count;
    uint32_t texel[FOOTPRINT_TEXELS];
    float share[FOOTPRINT_TEXELS]; /* sum to 1 */
};

/* Texels and weights of bilinear look-ups one texel apart, further in large footprints. Only texels of `chart` count,
 * by chart_of_texel[height][width]; returns their part of the look-ups' weight, 0 where there are none. */
float footprint_texels(struct footprint_texels *t, const struct footprint *f, uint32_t chart,
                       const uint32_t *chart_of_texel, uint32_t width, uint32_t height);

#endif
