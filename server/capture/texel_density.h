/* texel_density.h -- which charts photographs see; an atlas needs fewer texels for the others. */
#ifndef UNBAKE_CAPTURE_TEXEL_DENSITY_H
#define UNBAKE_CAPTURE_TEXEL_DENSITY_H

#include "common/parallel.h"
#include "server/capture/views.h"
#include "server/scene/atlas.h"

/* Linear texel density of what no photograph sees: it reflects light, which needs no detail, and takes a sixteenth of
 * the texels; +25 %: -0.22 dB, roughness +0.07. */
#define TEXEL_DENSITY_UNSEEN 0.25f

/* Fills density[triangle_count], for atlas_make_uneven: 1 where a photograph sees any part of the triangle's chart,
 * TEXEL_DENSITY_UNSEEN where none does. */
void texel_density_from_views(const struct views *views, const struct atlas *atlas, struct parallel *pool,
                              float *density);

#endif
