/* reach.h -- from which directions distant light finds its way into a room, and how much of it.
 *
 * A room with a window gets distant light from a few directions only, and most samples towards a
 * bright sky end at a wall. So for each of REACH_COLUMNS x REACH_ROWS bins of directions the mean
 * over the front sides of all surface of cosine x visibility is estimated, by a few rays each:
 * where samples are worth taking, and how much light arrives in all. Only the density of samples
 * depends on it, never what they bring: it may be coarse. */
#ifndef UNBAKE_RENDER_REACH_H
#define UNBAKE_RENDER_REACH_H

#include "common/parallel.h"
#include "common/vec.h"
#include "server/render/accel.h"
#include "server/scene/latlong.h"
#include "server/scene/mesh.h"

#define REACH_COLUMNS 64
#define REACH_ROWS 32

struct reach {
    float share[REACH_ROWS][REACH_COLUMNS]; /* mean cosine x visibility, in [0, 1] */
    double area;                            /* of all surface, m^2 */
};

/* Bins are even in azimuth and polar angle (struct latlong). The same for any number of threads. */
void reach_measure(struct reach *reach, const struct mesh *mesh, const struct accel *accel,
                   struct parallel *pool);

/* The share of the bin that holds a direction; around = 1 is 0 again. */
static inline float reach_share(const struct reach *reach, struct latlong at) {
    int x = (int)(at.around * REACH_COLUMNS) % REACH_COLUMNS, y = (int)(at.down * REACH_ROWS);
    return reach->share[y < REACH_ROWS ? y : REACH_ROWS - 1][x];
}

#endif
