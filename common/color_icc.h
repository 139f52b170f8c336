/* color_icc.h -- ICC profiles by Little CMS (littlecms.com, its API manual), from memory and to memory. */
#ifndef UNBAKE_COMMON_COLOR_ICC_H
#define UNBAKE_COMMON_COLOR_ICC_H

#include "common/color.h"

/* Rec. 709 by a profile's tables, which only the library knows to read. */
struct color_icc;
void color_icc_free(struct color_icc *icc);
/* In place: pixel[count][3], stored values to linear light. */
void color_icc_convert(const struct color_icc *icc, float (*pixel)[3], size_t count);

#endif
