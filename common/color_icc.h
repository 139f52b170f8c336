/* color_icc.h -- colour spaces from ICC profiles, by Little CMS (littlecms.com, its API manual), in memory. For
 * the picture codecs. */
#ifndef UNBAKE_COMMON_COLOR_ICC_H
#define UNBAKE_COMMON_COLOR_ICC_H

#include "common/color.h"

/* Sets *color, which must be initialised, from a profile, which is borrowed. An unusable one gives a warning and
 * sRGB. */
void color_set_profile(struct color *color, const void *profile, size_t size, bool is_grey, int bits);

/* CMYK: from inks, 0 (none) to 1 (full), to stored values of sRGB. By the profile, which is borrowed and may have size
 * 0; without a usable one by the plain formula (1 - C)(1 - K), and *warning says so. */
struct color_inks;
struct color_inks *color_inks_new(const void *profile, size_t size, char warning[COLOR_WARNING_SIZE]);
void color_inks_convert(const struct color_inks *inks, const float *cmyk, float *rgb, size_t count);
void color_inks_free(struct color_inks *inks);

#define COLOR_VERSION_SIZE 24                          /* bytes with the NUL */
void color_icc_version(char text[COLOR_VERSION_SIZE]); /* of Little CMS: "2.14" */

#endif
