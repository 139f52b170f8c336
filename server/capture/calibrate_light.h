/* calibrate_light.h -- exposure, white balance and vignette of photographs, from their overlaps.
 *
 * The logarithm of what photograph f shows of point p in channel c is taken as
 *
 *     L[p][c] + G[f][c] + v0 s + v1 s^2 + v2 s^3 + error,     s as in photograph.h,
 *
 * and G and v come by weighted least squares with the L eliminated; weights let outliers
 * (highlights, edges) go and count contrast and grazing looks less. Exposures that nobody told are
 * always solved. Three faults are assumed only where the capture shows them: drift of exposures
 * that are told, white balance that changes, a vignette. One is taken up when it makes photographs
 * agree clearly better at points that were held back from the solve; else it stays exactly none. */
#ifndef UNBAKE_CAPTURE_CALIBRATE_LIGHT_H
#define UNBAKE_CAPTURE_CALIBRATE_LIGHT_H

#include <stdbool.h>

#include "common/parallel.h"
#include "server/capture/views.h"
#include "server/scene/atlas.h"
#include "server/scene/inverse_uv.h"

struct light_found {
    size_t exposures_solved;  /* that nobody told */
    bool drift, white_balance, vignette; /* whether it was taken up */
    double spread_before, spread_after;  /* rms of the logarithm of what photographs show of a point
                                          * about the point's mean, all channels */
};

/* Sets exposure, gain and vignette of the training photographs, and the vignette of all; what they
 * were set to before is the claim that it starts from. With `faults` false only exposures that are
 * not told are solved. The gauge: where nothing tells the mean, mean G is 0. Same for any number
 * of threads. */
void calibrate_light(struct scene *scene, const struct views *views, const struct atlas *atlas,
                     const struct inverse_uv *inverse, bool faults, struct parallel *pool,
                     struct light_found *found);

#endif
