/* triangle_light.h -- the light that each triangle sends out, as photographs show it, before there is a
 * texture to keep it in.
 *
 * Exposures must be known. One value a triangle: what is painted on a large one is lost. */
#ifndef UNBAKE_CAPTURE_TRIANGLE_LIGHT_H
#define UNBAKE_CAPTURE_TRIANGLE_LIGHT_H

#include <stdbool.h>
#include <stddef.h>

#include "common/parallel.h"
#include "server/capture/views.h"

struct triangle_light {
    float *observed;  /* [triangle_count] radiance, mean of the channels, that most looks show at least: a highlight
                    * wanders with the camera, what shines itself does not; negative: no clean look; owned */
    float *mean;   /* [triangle_count] the mean of what looks show; negative as above; owned */
    bool *is_bound; /* [triangle_count] all of them saturate: it is more; owned */
    float *pixels; /* [triangle_count] pixels that it fills in a photograph, about; owned */
};

/* The same for any number of threads. */
void triangle_light_measure(struct triangle_light *light, const struct views *views, struct parallel *pool);
void triangle_light_release(struct triangle_light *light);

#endif
