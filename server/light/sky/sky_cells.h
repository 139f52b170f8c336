/* sky_cells.h -- a coarse latitude-longitude map of unseen directions (layout of world.h), bilinear between the centres
 * of its cells. */
#ifndef UNBAKE_LIGHT_SKY_SKY_CELLS_H
#define UNBAKE_LIGHT_SKY_SKY_CELLS_H

#include <stddef.h>

#include "common/vec.h"

#define SKY_COLUMNS 12
#define SKY_ROWS 6
#define SKY_CELLS (SKY_COLUMNS * SKY_ROWS)

/* The four cells around a unit direction and their weights, whose sum is 1. */
struct sky_corners {
    size_t cell[4];
    float weight[4];
};
struct sky_corners sky_cells_around(vec3 direction);

/* The half of the sphere (environment.h) in which a cell lies. */
size_t sky_cells_half(size_t cell);

/* Radiance of a unit direction, by the logarithms of the cells' radiances. */
double sky_cells_radiance(const double log_radiance[SKY_CELLS], vec3 direction);

#endif
