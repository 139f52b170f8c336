/* sky.h -- distant light without the sun, for formats in which the sun is a light of its own. */
#ifndef UNBAKE_EXPORT_SKY_H
#define UNBAKE_EXPORT_SKY_H

#include "common/image.h"
#include "server/export/input.h"

/* A copy of the environment in which the sun's pixels have the mean of those around it. There must be both. */
void sky_without_sun(const struct export_input *input, struct image *sky);

#endif
