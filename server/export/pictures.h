/* pictures.h -- the images that outputs.c writes: textures to ship, previews, side-by-sides. */
#ifndef UNBAKE_EXPORT_PICTURES_H
#define UNBAKE_EXPORT_PICTURES_H

#include <stdint.h>

#include "common/image.h"
#include "server/export/input.h"

/* What a texture or preview shows. */
enum picture_kind {
    PICTURE_BASE_COLOR, /* R G B in [0, 1] */
    PICTURE_EMISSION,   /* R G B radiance */
    PICTURE_ROUGHNESS,  /* Y in [0, 1] */
    PICTURE_SPECULAR,   /* Y in [0, 1] */
    PICTURE_CONFIDENCE  /* count, spread */
};

/* For each texel the valid texel whose value it shows: itself where valid, the (nearly) nearest
 * valid one within EXPORT_MARGIN texels, INVERSE_UV_NONE elsewhere. [height][width], the
 * caller's. */
uint32_t *picture_margin(const struct inverse_uv *inverse);

/* The texture at full size; `source` as picture_margin gave it. Confidence has no margin: what
 * is not on a surface was never observed. */
void picture_texture(const struct export_input *input, enum picture_kind kind,
                     const uint32_t *source, struct image *image);

/* At most EXPORT_PREVIEW_SIZE texels a side, means over valid texels, R G B ready for
 * image_write_png with scale 1: base colour as it is, roughness and specular as the grey of
 * their value, emission compressed by 1 / (1 + maximum), confidence from dark blue (few
 * observations) to yellow (many), red where a surface was never observed. */
void picture_preview(const struct export_input *input, enum picture_kind kind,
                     struct image *image);

/* The measured light, as large as the others, its median at mid grey. It must be there. */
void picture_radiance(const struct export_input *input, struct image *image);

/* The environment with the typical luminance of what was seen at mid grey; what was filled in is
 * at half its brightness. There must be one. */
void picture_environment(const struct export_input *input, struct image *image);

/* The factor that brings the 80th percentile of a picture's luminance to 0.6: bright, lamps clipped. */
float picture_scale(const struct image *picture);

/* Photograph | re-render | signed relative difference of luminance (red: the re-render is too
 * bright, blue: too dark, white: equal). One exposure for both pictures, chosen from the
 * photograph. */
void picture_comparison(const struct export_comparison *comparison, struct image *image);

#endif
