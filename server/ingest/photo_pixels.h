/* photo_pixels.h -- the pixels of photographs: from a decoded picture to half precision, and which are masked. Arrays
 * of photographs are taken from photo->spill, where room for them was reserved. */
#ifndef UNBAKE_INGEST_PHOTO_PIXELS_H
#define UNBAKE_INGEST_PHOTO_PIXELS_H

#include <stdbool.h>

#include "common/image.h"
#include "server/ingest/photo_faults.h"
#include "server/scene/photograph.h"

/* [65536] linear half value of a 16-bit sRGB code value; the caller's. */
uint16_t *photo_pixels_table(void);

/* Fill photo->pixel, and count in *faults. Linear values from the largest number of half precision on become lower
 * bounds, as clipped ones, unless they are connected with pixels that are no numbers: light never makes these, so all
 * of such a patch is a fault, and none of it is used. Negative values (from filters or colours outside of Rec. 709)
 * become 0. */
void photo_pixels_from_srgb(const uint16_t *half_of_srgb, const struct image *image, struct photograph *photo);
void photo_pixels_from_linear(const struct image *image, const struct image_info *info, struct photograph *photo,
                              struct photo_faults *faults);

/* Transparent pixels of a PNG have no content. An EXR's alpha only marks whether a ray hit surface; the light behind
 * it is real. */
void photo_pixels_mask_by_alpha(const struct image *image, struct photograph *photo);

/* Excludes what lies farther from the picture's centre, pixels: the black around a fisheye's circle. */
void photo_pixels_mask_by_circle(double radius, struct photograph *photo);

/* Excludes what is black in the mask dir/name (nerfstudio's convention), of the photograph's size or a multiple of it.
 * `turn` is the orientation by which the photograph was turned. *is_broken: the file cannot be decoded. */
enum status photo_pixels_load_mask(const char *dir, const char *name, int turn, struct photograph *photo,
                                   bool *is_broken, struct error *err);

#endif
