/* inverse_uv.h -- from a texel back to the surface.
 *
 * A texel is valid when a triangle covers any part of it (coverage.h: exact, not sampled at
 * centres): thin triangles get texels too, and every point of the surface lands on a valid
 * texel. It belongs to the triangle that holds its centre; failing that, to the covering one with
 * the point nearest the centre; the lower number among equals. */
#ifndef UNBAKE_SCENE_INVERSE_UV_H
#define UNBAKE_SCENE_INVERSE_UV_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/parallel.h"
#include "server/scene/atlas.h"

#define INVERSE_UV_NONE UINT32_MAX /* in place of a triangle */

struct inverse_uv {
    uint32_t width, height;
    uint32_t *triangle; /* [height][width], INVERSE_UV_NONE where not valid; owned */
    size_t valid_count;
    uint32_t *valid; /* [valid_count] texel numbers y * width + x, in tiles of 32 x 32 texels
                           * (row by row of tiles, row by row within one): neighbours in this
                           * list are neighbours on the surface; owned */
};

/* The result does not depend on the number of threads. */
void inverse_uv_make(struct inverse_uv *inverse, const struct atlas *atlas, size_t triangle_count,
                     struct parallel *pool);
void inverse_uv_release(struct inverse_uv *inverse);

/* Surface point at (x, y), in texels, inside a valid texel: barycentrics, on the texel's own triangle, of its point
 * nearest to (x, y). False when the texel is not valid. */
bool inverse_uv_lookup(const struct inverse_uv *inverse, const struct atlas *atlas, float x, float y,
                       uint32_t *triangle, float *b1, float *b2);

#endif
