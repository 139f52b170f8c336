/* surface.h -- a texture of 8 x 8 texels that two triangles cover, one of each segment and chart: the
 * left half and the right one. The last column is not valid. */
#ifndef UNBAKE_TESTS_UNIT_SURFACE_H
#define UNBAKE_TESTS_UNIT_SURFACE_H

#include "server/scene/inverse_uv.h"
#include "server/scene/segment.h"

#define SIDE 8
#define TEXELS (SIDE * SIDE)

static uint32_t triangle[TEXELS], valid[TEXELS], of_triangle[2] = {0, 1};
static struct inverse_uv inverse = {.width = SIDE, .height = SIDE, .triangle = triangle, .valid = valid};
static struct segments segments = {.count = 2, .of_triangle = of_triangle};

static inline void make_surface(void) {
    inverse.valid_count = 0;
    for (uint32_t i = 0; i < TEXELS; i++) {
        uint32_t x = i % SIDE;
        triangle[i] = x == SIDE - 1 ? INVERSE_UV_NONE : x < SIDE / 2 ? 0 : 1;
        if (triangle[i] != INVERSE_UV_NONE)
            valid[inverse.valid_count++] = i;
    }
}

#endif
