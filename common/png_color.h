/* png_color.h -- what a PNG file says of its colours. Private to the PNG codec. */
#ifndef UNBAKE_COMMON_PNG_COLOR_H
#define UNBAKE_COMMON_PNG_COLOR_H

#include "common/color.h"
#include "common/image_codec.h"

/* Reads cICP, iCCP, sRGB, cHRM and gAMA, in this order of precedence (PNG specification, third edition, 4.3), of a file
 * whose chunks all lie inside of it. What is damaged or not known is a warning in *color, and sRGB. False where the file says nothing that could be
 * used. */
bool png_color_read(struct image_source *source, bool is_grey, int bits, struct color *color);

#endif
