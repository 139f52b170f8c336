/* path_batch.h -- the paths of a batch while they are traced and walked backwards: path_memory.c makes room for them,
 * path.c fills it, path_backward.c reads it. Internal to these three. */
#ifndef UNBAKE_RENDER_PATH_BATCH_H
#define UNBAKE_RENDER_PATH_BATCH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "server/render/accel.h"
#include "server/render/lanes.h"

#define PATH_MAX_DEPTH 32 /* segments of a path whose vertices are kept */

/* A path under way to its next surface. */
struct path_state {
    uint32_t path, parent;
    rgb beta, rr_beta; /* see struct shade_block */
    uint32_t row;      /* of the guide, where it starts */
    float pdf;         /* of its direction by solid angle; 0 for a camera ray */
};

/* A light sample that waits for its shadow ray. */
struct shadow {
    uint32_t path, vertex;
    rgb contribution;
};

struct path_batch {
    size_t capacity;
    bool keeps_vertices;        /* vertices, for the backward walk */
    int max_depth, depth_count; /* depths used by the last trace */
    bool has_pattern;           /* the materials have an emission pattern */
    bool ended;                 /* vertices of the last depth used do not scatter */
    size_t vertex_count[PATH_MAX_DEPTH];
    struct vertex_block *vertex[PATH_MAX_DEPTH]; /* [capacity / LANES, rounded up] each, owned; unless vertices
                                             * are kept there is one block, that of the vertices at hand */
    struct shade_block *shade;
    struct shade_derivative *derivative;
    struct path_state *state;           /* [capacity] */
    struct accel_ray *ray, *shadow_ray; /* [capacity] */
    struct accel_hit *hit;              /* [capacity] */
    struct shadow *shadow;              /* [capacity] */
    uint8_t *bucket;                    /* [capacity] of each: rises with the number of its light */
    struct accel_ray *sorted_ray;       /* [capacity] the shadow rays by bucket */
    struct shadow *sorted;              /* [capacity] and what waits for them */
    uint8_t *occluded;                  /* [capacity] */
    uint32_t *key, *sample;             /* [capacity] per path, of the sampler */
    bool *dropped;                      /* [capacity] the path's estimate was not finite */
    rgb *direct;                        /* [capacity] see path_batch_direct */
    size_t active_count, shadow_count;
    unsigned bucket_shift; /* a light's bucket is its number shifted down by so many bits */
    uint64_t ray_count, dropped_count;
    void (*tap)(void *user, bool shadow, size_t count, const struct accel_ray *ray);
    void *tap_user;
};

#endif
