/* emission_texture.h -- emission for formats whose textures have 8 bits: a picture of what emitters with a pattern
 * (materials.h) show, and the radiance of each segment that is white in it. Segments without a pattern are
 * black there: these formats hold their radiance as a number. */
#ifndef UNBAKE_EXPORT_EMISSION_TEXTURE_H
#define UNBAKE_EXPORT_EMISSION_TEXTURE_H

#include "common/image.h"
#include "server/export/input.h"

/* [segment_count] the greatest radiance of a texel in any channel, 0 of segments without a pattern; the caller's. NULL
 * where no segment has one. */
float *emission_texture_whites(const struct export_input *input);

/* Linear R G B, radiance over whites[segment]. Texels read from source[], see picture_margin. */
void emission_texture(const struct export_input *input, const uint32_t *source, const float *whites,
                      struct image *image);

#endif
