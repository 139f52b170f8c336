/* coverage.h -- exactly which texels a triangle covers.
 *
 * Atlas coordinates are whole multiples of 1/COVERAGE_UNITS texel, and all decisions here are
 * exact: moving a triangle by whole texels, turning it by a quarter or mirroring it moves,
 * turns or mirrors the covered texels, so what held when a chart was packed holds in the atlas.
 *
 * A texel is covered when its square, grown by one unit on every side, meets the closed
 * triangle. One unit is more than single precision loses in interpolating atlas coordinates up
 * to 16384: every point of the surface lands on a covered texel, however it was rounded. */
#ifndef UNBAKE_SCENE_COVERAGE_H
#define UNBAKE_SCENE_COVERAGE_H

#include <stdint.h>

#define COVERAGE_UNITS 256 /* per texel */

/* Corners in units, |coordinate| < 2^23. Needs no area and no certain winding. */
struct coverage_triangle {
    int32_t x[3], y[3];
};

/* The rows [*first, *last] of cells that the triangle covers; a cell is a square of `cell` units,
 * a power of two. */
void coverage_rows(const struct coverage_triangle *triangle, int32_t cell, int32_t *first, int32_t *last);

/* The columns [*first, *last] that it covers in a row that coverage_rows names. */
void coverage_columns(const struct coverage_triangle *triangle, int32_t cell, int32_t row, int32_t *first,
                      int32_t *last);

#endif
