/* png_color.h -- the colour space of a PNG file. Private to the PNG codec. */
#ifndef UNBAKE_COMMON_PNG_COLOR_H
#define UNBAKE_COMMON_PNG_COLOR_H

#include "common/color.h"
#include "common/image_codec.h"

/* Reads cICP, iCCP, sRGB, cHRM and gAMA, in this order of precedence (PNG specification, third edition, 4.3). All
 * chunks must lie within the file. Damaged or unknown ones give a warning in *color and sRGB. False when the file has
 * no usable information. */
bool png_color_read(struct image_source *source, bool is_grey, int bits, struct color *color);

#endif
