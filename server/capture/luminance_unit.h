/* luminance_unit.h -- the luminance of radiance 1, by the settings of the cameras that took the photographs.
 *
 * A photograph shows radiance as pixel = exposure * radiance, in units of its own. Its camera's settings say what
 * luminance a pixel of 1 stands for: by ISO 12232:2019 (standard output sensitivity, which CIPA DC-004 asks cameras to
 * tell as their ISO) level 118 of 255 in sRGB is an exposure of 10 / ISO lux seconds of the sensor, and the sensor's is
 * q t L / N^2, q = .65 (ISO 12232: transmission of the lens, its fall-off, the angle), t in seconds, L in cd/m2. So a
 * pixel of 1 is 84.9 N^2 / (t ISO) cd/m2. The same of other conventions: 120 by the speed at saturation (78 / ISO lux
 * seconds), 69.4 by an exposure meter of K = 12.5 (ISO 2720) whose grey of .18 comes out as .18. */
#ifndef UNBAKE_CAPTURE_LUMINANCE_UNIT_H
#define UNBAKE_CAPTURE_LUMINANCE_UNIT_H

#include <stddef.h>

#include "server/scene/scene.h"

struct luminance_unit {
    double cd_per_m2;     /* of radiance 1 in red, green and blue; 0: the settings of too few are known */
    double within_factor; /* which the true one is likely not farther away */
    size_t photographs;   /* whose settings were used */
};

/* The median over the photographs that are not held out, are not HDR (their values have no white) and whose settings
 * are complete. The factor is of the conventions, and of the scatter between photographs. */
struct luminance_unit luminance_unit_find(const struct scene *scene);

#endif
