/* visibility.h -- how much light from each direction of the environment arrives on surfaces of a room.
 *
 * A room with a window gets environment light from a few directions only; most samples towards a bright sky end at a
 * wall. For each of VISIBILITY_COLUMNS x VISIBILITY_ROWS bins of directions the mean of cosine x visibility over the
 * front sides of all surfaces is estimated with a few rays. It guides sampling of the environment and gives the total
 * power that arrives. Only the density of samples depends on it, so it may be coarse. */
#ifndef UNBAKE_RENDER_VISIBILITY_H
#define UNBAKE_RENDER_VISIBILITY_H

#include "common/parallel.h"
#include "common/vec.h"
#include "server/render/accel.h"
#include "server/scene/latlong.h"
#include "server/scene/mesh.h"

#define VISIBILITY_COLUMNS 64
#define VISIBILITY_ROWS 32

struct visibility {
    float share[VISIBILITY_ROWS][VISIBILITY_COLUMNS]; /* mean of cosine x visibility, in [0, 1] */
    double area;                                      /* of all surfaces, m^2 */
};

/* Bins are uniform in azimuth and polar angle (struct latlong). The result does not depend on the number of threads. */
void visibility_measure(struct visibility *visibility, const struct mesh *mesh, const struct accel *accel,
                        struct parallel *pool);

/* The share of the bin that contains a direction; around = 1 wraps to 0. */
static inline float visibility_at(const struct visibility *visibility, struct latlong at) {
    int x = (int)(at.around * VISIBILITY_COLUMNS) % VISIBILITY_COLUMNS, y = (int)(at.down * VISIBILITY_ROWS);
    return visibility->share[y < VISIBILITY_ROWS ? y : VISIBILITY_ROWS - 1][x];
}

#endif
