/* unseen_fit.h -- fits radiance of unobserved directions (unseen_light.h) to points of the surface.
 *
 * The unknown is the logarithm of a coarse latitude-longitude map (layout of world.h), bilinear between the centres of
 * its cells. A point's radiance is base colour times Lambert radiance, by known light and by the map. Robust
 * Gauss-Newton with a smoothness prior makes base colours similar within a segment and plausible; a common factor then
 * leaves nine tenths of them below that of white paint. */
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

/* One point: its observed radiance; Lambert radiance at albedo 1 by known light, and by filled-in light; and the parts
 * of its cosine-distributed rays that go to each cell. Means of the channels. */
struct unseen_point {
    uint32_t segment;
    float shown, known, filled;
    float unseen, share[UNSEEN_CELLS]; /* unseen: the sum of the shares */
};

/* Quantile `below` of the points' base colour under a map, or, if it is NULL, under the filled-in light. */
double unseen_base_color(const struct unseen_point *point, size_t count, double below, const double *log_radiance);

/* Fills the map. Segments of the points are below segment_count. */
void unseen_fit(const struct unseen_point *point, size_t count, size_t segment_count,
                double log_radiance[UNSEEN_CELLS]);

#endif
