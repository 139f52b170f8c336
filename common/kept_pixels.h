/* kept_pixels.h -- how many pixels a job keeps of one photograph. */
#ifndef UNBAKE_COMMON_KEPT_PIXELS_H
#define UNBAKE_COMMON_KEPT_PIXELS_H

#include "common/settings.h"

/* By the setting photograph_megapixels, with textures of `side` texels a side; 0: all. */
double kept_pixels(const struct settings *settings, double side);

#endif
