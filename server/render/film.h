/* film.h -- pictures of a world through a camera. */
#ifndef UNBAKE_RENDER_FILM_H
#define UNBAKE_RENDER_FILM_H

#include <stdint.h>

#include "common/image.h"
#include "common/parallel.h"
#include "server/render/path.h"
#include "server/render/world.h"
#include "server/scene/camera.h"

/* Renders `spp` paths per pixel, jittered over the pixel (box filter), into a new image of
 * channels R G B and err.R err.G err.B: the mean, and the standard error of the mean from the
 * spread of FILM_GROUPS groups of samples (spp is rounded up to a multiple; the groups are
 * stratified within and independent of each other). `iteration` separates renders that must be
 * independent. Returns the number of samples dropped because they were not finite. Pixels whose
 * direction the lens does not define stay 0. The same for any number of threads. */
#define FILM_GROUPS 4
uint64_t film_render(const struct world *world, const struct camera *camera, uint32_t spp,
                     const struct path_settings *settings, uint32_t iteration,
                     struct parallel *pool, struct image *image);

/* What the first hits of `spp` jittered rays per pixel show, averaged: channels base_color.R G B,
 * roughness, specular, emission.R G B, segment (of the pixel's first sample, -1 where it met
 * nothing), depth (along the optical axis, of the samples that met something), coverage (share
 * of samples that met something). */
void film_render_first_hits(const struct world *world, const struct camera *camera, uint32_t spp,
                            uint64_t seed, struct parallel *pool, struct image *image);

#endif
