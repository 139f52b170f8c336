/* hole_observations.h -- pixels of the training photographs that look through holes or openings of the mesh, and what
 * all others say of the cells of a grid (hole_grid.h): which they pass, and how bright the mesh is that lies in
 * them. */
#ifndef UNBAKE_HOLES_HOLE_OBSERVATIONS_H
#define UNBAKE_HOLES_HOLE_OBSERVATIONS_H

#include "server/capture/views.h"
#include "server/holes/hole_grid.h"

/* Of the pixels that are asked for what they pass and what surface they see, along both axes, for time. */
#define HOLE_PASS_STRIDE 2

/* Least variance of log radiance among photographs that tells anything: of 3 %, which exposures and gloss leave. */
#define HOLE_LEAST_VARIANCE 1e-3

/* A pixel whose ray meets no surface and that is not dark. */
struct hole_observation {
    vec3 direction;            /* unit */
    float value;               /* log radiance; where it is saturated a lower bound, which is in no mean */
    uint32_t train;            /* index into views.train; observations are in its order */
    uint32_t cell;             /* that it is taken to see, or HOLE_NO_CELL */
    bool is_saturated, is_out; /* is_out: no cell on its way is left */
};

struct hole_observations {
    const struct views *views; /* borrowed */
    size_t count;
    struct hole_observation *item; /* [count]; owned */
};

/* Looks at up to 80,000 pixels of each photograph, and ten million of all. Exposures and poses must be known. */
void hole_observations_take(struct hole_observations *observations, struct hole_grid *grid, const struct views *views,
                            struct parallel *pool);
void hole_observations_release(struct hole_observations *observations);

/* Where the camera of an observation stands. */
static inline vec3 hole_observation_origin(const struct hole_observations *observations,
                                           const struct hole_observation *observation) {
    return camera_origin(
        &observations->views->scene->photograph[observations->views->train[observation->train]].camera);
}

/* Has each observation see the nearest cell on its way that is not refused, and adds up what the cells show. */
void hole_observations_assign(struct hole_observations *observations, struct hole_grid *grid);

#endif
