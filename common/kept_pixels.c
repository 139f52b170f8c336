/* kept_pixels.c -- see kept_pixels.h. */
#include "common/kept_pixels.h"

#include <math.h>

#define USUAL_SIDE 2048.0 /* texels, for which photograph_megapixels is told */

double kept_pixels(const struct settings *settings, double side) {
    double larger = fmax(side / USUAL_SIDE, 1.0);
    return 1e6 * settings_number(settings, "photograph_megapixels") * larger * larger;
}
