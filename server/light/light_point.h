/* light_point.h -- sample points of the surface for the estimate of light: their observed radiance, what known light a
 * surface of albedo 1 would send there, and how much of the sky they see. */
#ifndef UNBAKE_LIGHT_LIGHT_POINT_H
#define UNBAKE_LIGHT_LIGHT_POINT_H

#include "server/light/sky/light_sky.h"
#include "server/light/survey.h"
#include "server/scene/surface.h"

#define LIGHT_POINTS 8192
#define LIGHT_REGIONS 64 /* a grid of 4 x 4 x 4 over the room */

struct light_point {
    uint32_t segment, patch; /* a patch: points of one segment that are near each other and face the same way */
    struct surface_point at;
    rgb observed, known; /* outgoing radiance; that of a surface of albedo 1 by known light */
    float deviation;     /* standard deviation of log `known` by noise and by light that is not modelled */
    bool is_bound;       /* `observed` is a lower bound */
    bool is_lamp;        /* of a segment that may be a lamp */
    float escaping;      /* part of its cosine-distributed rays that leave the room in unseen directions */
    float *unobserved;   /* [LIGHT_REGIONS][3] the same by surfaces of each region that no photograph shows, which
                                 * `known` goes without; NULL: none; owned, as the next */
    float *sky;          /* [LIGHT_CELLS] parts of these rays that go to each cell; NULL: none do */
    float saturated[ENVIRONMENT_HALVES]; /* radiance of a surface of albedo 1 by saturated directions */
};

struct light_points {
    size_t count;
    struct light_point *point; /* [count] by segment and patch; owned */
    float edge_m;              /* of a patch */
    vec3 least, most;          /* corners of the room */
};

/* The edge of patches in a room, and the patch of a place: a cube of that edge, from the corner `least` of the room,
 * and which way its surface faces. */
float light_patch_edge(const struct mesh *mesh);
uint32_t light_patch(const struct surface_point *at, vec3 least, float edge_m);

/* The region of a place. */
size_t light_points_region(const struct light_points *p, vec3 place);

/* Makes the points from a survey, the world lit by light_sky_known. Observed radiance is that of `observed` around
 * each, or fused radiance where that has none or is NULL. median_radiance: of the room. The same for any number of
 * threads. */
void light_points_init(struct light_points *p, const struct survey *survey, const struct light_sky *sky,
                       const struct fused *observed, float median_radiance);
void light_points_release(struct light_points *p);

#endif
