/* texel_density.h -- which charts photographs see; an atlas needs fewer texels for the others. */
#ifndef UNBAKE_CAPTURE_TEXEL_DENSITY_H
#define UNBAKE_CAPTURE_TEXEL_DENSITY_H

#include "common/parallel.h"
#include "server/capture/views.h"
#include "server/scene/atlas.h"

/* Fills density[triangle_count], for atlas_make_uneven: 1 where a photograph sees any part of the triangle's chart,
 * less where none does. */
void texel_density_from_views(const struct views *views, const struct atlas *atlas, struct parallel *pool,
                              float *density);

#endif
