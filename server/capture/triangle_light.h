/* triangle_light.h -- the observed radiance of each triangle, before there is a texture to hold it.
 *
 * Exposures must be known. One value a triangle: detail of large ones is lost. */
#ifndef UNBAKE_CAPTURE_TRIANGLE_LIGHT_H
#define UNBAKE_CAPTURE_TRIANGLE_LIGHT_H

#include <stdbool.h>

#include "common/parallel.h"
#include "server/capture/views.h"

struct triangle_light {
    float *observed;  /* [triangle_count] radiance (mean of the channels) that most observations reach: emission is seen
                       * from everywhere, a highlight is not; negative: no clean observation; owned */
    float *mean;      /* [triangle_count] mean over observations; negative as above; owned */
    bool *is_bound;   /* [triangle_count] all are saturated: a lower bound; owned */
    bool *is_clipped; /* [triangle_count] and most in all channels; owned */
    float *pixels;    /* [triangle_count] pixels that it fills in a photograph, mean; owned */
};

/* The same for any number of threads. */
void triangle_light_measure(struct triangle_light *light, const struct views *views, struct parallel *pool);
void triangle_light_release(struct triangle_light *light);

#endif
