/* color_cicp.h -- colour spaces by the numbers of ITU-T H.273, as PNG's cICP and the nclx box of HEIF hold them.
 * Private to the picture codecs. */
#ifndef UNBAKE_COMMON_COLOR_CICP_H
#define UNBAKE_COMMON_COLOR_CICP_H

#include "common/color.h"

/* Sets *color, which must be initialised, from primaries, transfer, matrix and full-range flag of a picture in R, G, B
 * (matrix 0, full range 1). Unknown numbers give a warning, which begins with `place`, and sRGB. False unless the
 * numbers are used. */
bool color_set_cicp(struct color *color, const char *place, const uint8_t number[4], int bits);

#endif
