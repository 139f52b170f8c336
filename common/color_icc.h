/* color_icc.h -- colour spaces from ICC profiles, by Little CMS (littlecms.com, its API manual), in memory. Private
 * to the picture codecs. */
#ifndef UNBAKE_COMMON_COLOR_ICC_H
#define UNBAKE_COMMON_COLOR_ICC_H

#include "common/color.h"

/* Sets *color, which must be initialised, from a profile, which is borrowed. An unusable one gives a warning and
 * sRGB. */
void color_set_profile(struct color *color, const void *profile, size_t size, bool is_grey, int bits);

#endif
