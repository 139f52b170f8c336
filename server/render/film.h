/* film.h -- renders pictures of a scene. */
#ifndef UNBAKE_RENDER_FILM_H
#define UNBAKE_RENDER_FILM_H

#include <stdint.h>

#include "common/image.h"
#include "common/parallel.h"
#include "server/render/path.h"
#include "server/render/world.h"
#include "server/scene/camera.h"

#define FILM_GROUPS 4 /* of the samples of a pixel, from whose means its standard error is estimated */

/* Of a camera that looks in (camera.h), rays pass the backs of surfaces up to the first front; light does not.
 *
 * Renders `spp` paths per pixel, jittered over the pixel (box filter), into a new image of channels R G B and err.R
 * err.G err.B: the mean and its standard error, estimated from FILM_GROUPS independent groups of samples (spp is
 * rounded up to a multiple; each group is stratified). Renders of different `iteration` are independent. Returns the
 * number of non-finite samples dropped. Pixels without a direction (lens model) stay 0. The result does not depend on
 * the number of threads. */
uint64_t film_render(const struct world *world, const struct camera *camera, uint32_t spp,
                     const struct path_settings *settings, uint32_t iteration, struct parallel *pool,
                     struct image *image);

/* The same with three more channels, direct.R G B: the part of the mean that was reflected once at most. */
uint64_t film_render_direct(const struct world *world, const struct camera *camera, uint32_t spp,
                            const struct path_settings *settings, uint32_t iteration, struct parallel *pool,
                            struct image *image);

/* The same paths as two independent renders of half of them each: channels a.R a.G a.B b.R b.G b.B. Their mean is
 * film_render's. What is a product of both, or of their differences from something, is free of noise in the mean. */
uint64_t film_render_halves(const struct world *world, const struct camera *camera, uint32_t spp,
                            const struct path_settings *settings, uint32_t iteration, struct parallel *pool,
                            struct image *image);

/* First-hit attributes, averaged over `spp` jittered rays per pixel: channels base_color.R G B, roughness, specular,
 * emission.R G B, segment (of the pixel's first sample, -1 for a miss), coverage (share of samples that hit), and over
 * hits: depth (along the optical axis; of a panorama the distance), normal.X Y Z (shading normal, on the viewer's side,
 * not normalised) and position.X Y Z. */
void film_render_first_hits(const struct world *world, const struct camera *camera, uint32_t spp, uint64_t seed,
                            struct parallel *pool, struct image *image);

#endif
