/* path.h -- path tracing with derivatives: forward once, then backwards over the stored path.
 *
 * A batch holds the paths of many camera rays. path_batch_trace estimates each ray's radiance
 * by next-event estimation with multiple importance sampling and keeps the vertices;
 * path_batch_backward walks them from the end and turns the derivative of a loss by each ray's
 * radiance into derivatives by base colour (at every texel that the path touched, through the
 * texture filter), roughness, specular and emission. Sampling is detached: densities are
 * constants (Zeltner et al. 2021), so the gradient of the estimator's expectation is unbiased. */
#ifndef UNBAKE_RENDER_PATH_H
#define UNBAKE_RENDER_PATH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/vec.h"
#include "server/render/gradient.h"
#include "server/render/world.h"

/* settings.least_color where derivatives are wanted. With .3 the gradient of a room of dark tiles has a third less variance
 * for a fifth more time. */
#define PATH_LEAST_COLOR 0.1f

struct path_settings {
    int max_depth;      /* segments from the camera: 1 emission only, 2 direct light, ... <= 32 */
    int roulette_depth; /* Russian roulette decides on this segment and those after it. Where it is
                         * at most max_depth, light samples that can bring only little play too;
                         * otherwise nothing is left to chance */
    bool derivatives;   /* are wanted: roulette ends fewer paths, since what they log at far vertices
                         * is scattered over many texels, whose noise falls only with their number */
    uint64_t seed;
    float least_color;  /* roulette takes no base colour for darker than this: derivatives by base
                         * colour are no smaller where it is dark. 0 where only pictures are wanted */
};

/* Names the random numbers of one path: a pure function of these and the seed. Consecutive
 * `sample` numbers with equal other fields are stratified against each other. */
struct path_key {
    uint32_t index;     /* texel, or pixel */
    uint32_t iteration;
    uint32_t sample;
};

struct ray {
    vec3 origin;
    vec3 direction; /* unit */
};

struct path_batch; /* scratch of one thread; opaque */

struct path_batch *path_batch_new(size_t capacity, int max_depth);
/* One of whose paths only the radiance is wanted, of any depth: it keeps no vertices, which makes
 * them 3 % faster and needs less memory. path_batch_backward must not be called. */
struct path_batch *path_batch_new_forward(size_t capacity);
void path_batch_free(struct path_batch *batch);

/* radiance[count] out. count <= capacity. Rays are traced from their origin; the first surface
 * hit is the first vertex. Non-finite estimates become 0 and are counted. Allocates nothing. */
void path_batch_trace(struct path_batch *batch, const struct world *world,
                      const struct path_settings *settings, size_t count, const struct ray *ray,
                      const struct path_key *key, rgb *radiance);

/* Appends to `log` the derivatives for d_radiance[count], the loss's derivative by each ray's
 * radiance, of the paths that path_batch_trace left in the batch, with the materials as they were
 * then. */
void path_batch_backward(struct path_batch *batch, const rgb *d_radiance, struct gradient_log *log);

/* Calls tap(user, shadow, count, ray) before each group of rays is traced, in the order of their paths;
 * shadow tells rays that only ask whether anything is in the way. For benches that measure the same rays
 * elsewhere. */
struct accel_ray;
void path_batch_set_tap(struct path_batch *batch,
                        void (*tap)(void *user, bool shadow, size_t count, const struct accel_ray *ray),
                        void *user);

/* Rays traced and non-finite samples dropped through this batch since it was made. */
void path_batch_counts(const struct path_batch *batch, uint64_t *ray_count, uint64_t *dropped_count);

#endif
