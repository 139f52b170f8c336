/* color_icc.h -- what an ICC profile says of a picture's colours, by Little CMS (littlecms.com, its API manual); from memory,
 * without files. Private to the picture codecs. */
#ifndef UNBAKE_COMMON_COLOR_ICC_H
#define UNBAKE_COMMON_COLOR_ICC_H

#include "common/color.h"

/* Sets *color, which was initialised, by the profile, which is borrowed. What cannot be used is a warning, and sRGB. */
void color_set_profile(struct color *color, const void *profile, size_t size, bool is_grey, int bits);

#endif
