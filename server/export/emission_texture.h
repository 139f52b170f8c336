/* emission_texture.h -- emission for formats with 8-bit textures: a picture of emitters with a pattern (materials.h),
 * scaled to [0, 1] per segment, and the scales. Segments without a pattern are black in it; their radiance is a
 * number in those formats. */
#ifndef UNBAKE_EXPORT_EMISSION_TEXTURE_H
#define UNBAKE_EXPORT_EMISSION_TEXTURE_H

#include "common/image.h"
#include "server/export/input.h"

/* [segment_count] greatest radiance of a texel in any channel, 0 for segments without a pattern; the caller's. NULL
 * when no segment has a pattern. */
float *emission_texture_scales(const struct export_input *input);

/* Linear R G B: radiance over scales[segment]. source[] is that of picture_margin. */
void emission_texture(const struct export_input *input, const uint32_t *source, const float *scales,
                      struct image *image);

#endif
