/* unseen_fit.h -- fits radiance of unobserved directions (unseen_light.h) to points of the surface.
 *
 * The unknown is the logarithm of a coarse map (sky_cells.h), whose cells are sources of a joint fit (joint_fit.h): of
 * each no more is known than that the map was even (LIGHT_UNKNOWN_DEVIATION). Neighbouring cells are not tied: skies
 * get brighter upwards by factors, and an even one needs more light of it to explain the same shade. How bright the
 * whole is hardly shows, so a common factor then leaves nine tenths of the base colours below that of white paint. */
#ifndef UNBAKE_LIGHT_SKY_UNSEEN_FIT_H
#define UNBAKE_LIGHT_SKY_UNSEEN_FIT_H

#include <stddef.h>
#include <stdint.h>

#include "common/parallel.h"
#include "server/light/sky/sky_cells.h"

/* One point: its observed radiance; Lambert radiance at albedo 1 by known light, and by filled-in light; and the parts
 * of its cosine-distributed rays that go to each cell. Means of the channels. */
struct unseen_point {
    uint32_t segment;
    float observed, known, filled;
    float unseen, share[SKY_CELLS]; /* unseen: the sum of the shares */
};

/* Adds a ray of weight `share` that leaves in an unobserved unit direction, with the filled-in radiance from there. */
void unseen_add_ray(struct unseen_point *p, vec3 direction, float share, float filled);

/* Moves the points that unobserved directions light noticeably to the front; returns their number. */
size_t unseen_keep_informative(struct unseen_point *point, size_t count);
/* Least number of these. */
#define UNSEEN_MIN_POINTS 64

/* The part of all the points' rays that is unseen. */
double unseen_share(const struct unseen_point *point, size_t count);

/* Quantile `below` of the points' base colour under a map, or, if it is NULL, under the filled-in light. */
double unseen_base_color(const struct unseen_point *point, size_t count, double below, const double *log_radiance);

/* Fills the map, and sorts the points. The same for any number of threads. */
void unseen_fit(struct unseen_point *point, size_t count, struct parallel *pool, double log_radiance[SKY_CELLS]);

#endif
