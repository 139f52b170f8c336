/* path.h -- differentiable path tracing: a forward pass, then a backward pass over the stored paths.
 *
 * path_batch_trace estimates the radiance of a batch of camera rays by next-event estimation with multiple importance
 * sampling and stores the vertices. path_batch_backward goes through them in reverse and turns the derivative of a
 * loss by each ray's radiance into derivatives by base colour (at every texel that the path touched, through the
 * texture filter), roughness, specular and emission. Sampling is detached: densities are constants (Zeltner et al.
 * 2021), which is unbiased for the gradient of the expected radiance. */
#ifndef UNBAKE_RENDER_PATH_H
#define UNBAKE_RENDER_PATH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/vec.h"
#include "server/render/gradient.h"
#include "server/render/world.h"

/* settings.min_color when derivatives are wanted. 0.3 reduces the variance of the gradient in a room of dark tiles
 * by a third, for a fifth more time. */
#define PATH_MIN_COLOR 0.1f

struct path_settings {
    int max_depth;      /* path segments from the camera: 1 emission only, 2 direct light, ... <= 32 */
    int roulette_depth; /* Russian roulette applies to this segment and later ones, and to light samples of low
                         * contribution at any. Above max_depth: no roulette at all */
    bool derivatives;   /* roulette ends fewer paths, since derivatives of far vertices scatter over many texels and
                         * their noise falls only with the number of paths */
    uint64_t seed;
    float min_color; /* base colours are clamped to this from below for roulette: derivatives by base colour are no
                         * smaller where it is dark. 0 when only pictures are wanted */
};

/* Names the random numbers of one path, a pure function of these and the seed. Samples of consecutive `sample`
 * numbers and equal other fields are stratified. */
struct path_key {
    uint32_t index; /* texel, or pixel */
    uint32_t iteration;
    uint32_t sample;
};

struct ray {
    vec3 origin;
    vec3 direction; /* unit */
};

struct path_batch; /* scratch of one thread; opaque */

struct path_batch *path_batch_new(size_t capacity, int max_depth);
/* For radiance only: stores no vertices, any depth. 3 % faster and with less memory. path_batch_backward must not be
 * called. */
struct path_batch *path_batch_new_forward(size_t capacity);
void path_batch_free(struct path_batch *batch);

/* Sets radiance[count]; count <= capacity. The first surface hit is the first vertex. Non-finite estimates become 0
 * and are counted. Allocates nothing. */
void path_batch_trace(struct path_batch *batch, const struct world *world, const struct path_settings *settings,
                      size_t count, const struct ray *ray, const struct path_key *key, rgb *radiance);

/* Of the last path_batch_trace, the part of each ray's radiance that was reflected once at most: what emits, seen by
 * the camera, and direct light. Borrowed until the next. */
const rgb *path_batch_direct(const struct path_batch *batch);

/* Appends to `log` the derivatives of the paths of the last path_batch_trace, given d_radiance[count], the derivative
 * of the loss by each ray's radiance. The materials must be unchanged. */
void path_batch_backward(struct path_batch *batch, const rgb *d_radiance, struct gradient_log *log);

/* Calls tap(user, shadow, count, ray) before each group of rays is traced, in the order of their paths; `shadow` is
 * true for occlusion queries. For benchmarks that trace the same rays by other means. */
struct accel_ray;
void path_batch_set_tap(struct path_batch *batch,
                        void (*tap)(void *user, bool shadow, size_t count, const struct accel_ray *ray), void *user);

/* Rays traced and non-finite samples dropped since the batch was made. */
void path_batch_counts(const struct path_batch *batch, uint64_t *ray_count, uint64_t *dropped_count);

#endif
