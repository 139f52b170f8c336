/* pictures.h -- the images that outputs.c writes: textures, previews, comparisons. */
#ifndef UNBAKE_EXPORT_PICTURES_H
#define UNBAKE_EXPORT_PICTURES_H

#include <stdint.h>

#include "common/image.h"
#include "server/export/input.h"

/* Content of a texture or preview. */
enum picture_kind {
    PICTURE_BASE_COLOR, /* R G B in [0, 1] */
    PICTURE_EMISSION,   /* R G B radiance */
    PICTURE_ROUGHNESS,  /* Y in [0, 1] */
    PICTURE_SPECULAR,   /* Y in [0, 1] */
    PICTURE_CONFIDENCE  /* R G B: standard deviation of base colour */
};

/* Source texel of each texel: itself if valid, the (approximately) nearest valid one within EXPORT_MARGIN texels, or
 * INVERSE_UV_NONE. [height][width], the caller's. */
uint32_t *picture_margin(const struct inverse_uv *inverse);

/* The full-size texture; `source` is from picture_margin. Confidence has no margin. */
void picture_texture(const struct export_input *input, enum picture_kind kind, const uint32_t *source,
                     struct image *image);

/* At most EXPORT_PREVIEW_SIZE texels a side, mean over valid texels, R G B for image_write_png with scale 1: base
 * colour unchanged, roughness and specular as grey, emission compressed by 1 / (1 + maximum), confidence from
 * yellow (a deviation of .01 and less) to dark blue (of .2 and more). */
void picture_preview(const struct export_input *input, enum picture_kind kind, struct image *image);

/* The measured light, as large as the others, its median at mid grey. It must be there. */
void picture_radiance(const struct export_input *input, struct image *image);

/* The environment, exposed so that the typical luminance of its observed part is mid grey; filled-in parts are shown
 * at half brightness. There must be an environment. */
void picture_environment(const struct export_input *input, struct image *image);

/* Exposure that maps the 80th percentile of luminance to 0.6; lamps clip. */
float picture_scale(const struct image *picture);

/* Photograph | re-render | signed relative difference of luminance (red: re-render too bright, blue: too dark, white:
 * equal). Both pictures have one exposure, chosen from the photograph. */
void picture_comparison(const struct export_comparison *comparison, struct image *image);

#endif
