/* unseen_fit.h -- how much light comes from the unseen directions (unseen_light.h), by what it does to
 * points of the surface.
 *
 * Unknown is the logarithm of a coarse latitude-longitude map (layout of world.h), linear between the
 * centres of its cells. What a point shows is base colour times the light that is known and that of the map.
 * Robust Gauss-Newton, with a pull of neighbouring cells to each other, makes base colours alike within a
 * segment and not whiter than white; a factor on the whole then leaves nine tenths of them below that. */
#ifndef UNBAKE_LIGHT_UNSEEN_FIT_H
#define UNBAKE_LIGHT_UNSEEN_FIT_H

#include <stddef.h>
#include <stdint.h>

#include "common/vec.h"

#define UNSEEN_COLUMNS 12
#define UNSEEN_ROWS 6
#define UNSEEN_CELLS (UNSEEN_COLUMNS * UNSEEN_ROWS)

/* The four cells around a unit direction and their weights, whose sum is 1. */
struct unseen_corners {
    size_t cell[4];
    float weight[4];
};
struct unseen_corners unseen_corners(vec3 direction);

/* One point: the radiance that it shows; what a white surface there would send back of the light that is
 * known, and of what was filled in; and which shares of its rays, by cosine, go to each cell. Means of the
 * channels. */
struct unseen_point {
    uint32_t segment;
    float shown, known, filled;
    float unseen, share[UNSEEN_CELLS]; /* unseen: the sum of the shares */
};

/* Base colour that part `below` of the points do not exceed under a map, or, if it is NULL, under what was
 * filled in. */
double unseen_base_color(const struct unseen_point *point, size_t count, double below, const double *log_radiance);

/* Fills the map. Segments of the points are below segment_count. */
void unseen_fit(const struct unseen_point *point, size_t count, size_t segment_count,
                double log_radiance[UNSEEN_CELLS]);

#endif
