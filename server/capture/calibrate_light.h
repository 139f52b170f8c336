/* calibrate_light.h -- exposure, white balance, vignette and tone curve of photographs, from points that several see.
 *
 * The logarithm of what photograph f shows of point p in channel c is modelled as
 *
 *      L[p][c] + G[f][c] + v0 s + v1 s^2 + v2 s^3 + error,     s as in photograph.h,
 *
 * and G and v come by weighted least squares with the L eliminated. Robust weights suppress outliers (highlights,
 * edges); contrast and grazing angles lower weights. Exposures that the bundle does not give are always solved. Four
 * faults are modelled only where the capture shows them: drift of given exposures, changing white balance, a vignette,
 * and a tone curve of the camera (tone_curve.h) where no photograph is HDR. A fault is accepted when it makes
 * photographs agree significantly better at points held out from the solve; otherwise it is exactly zero. */
#ifndef UNBAKE_CAPTURE_CALIBRATE_LIGHT_H
#define UNBAKE_CAPTURE_CALIBRATE_LIGHT_H

#include <stdbool.h>

#include "common/parallel.h"
#include "server/capture/light_fit.h"
#include "server/capture/views.h"
#include "server/scene/atlas.h"
#include "server/scene/inverse_uv.h"

struct light_found {
    size_t exposures_solved;                    /* that the bundle does not give */
    bool drift, white_balance, vignette, tones; /* whether the fault was accepted */
    struct tone_curve curve;
    bool is_power_open;                 /* of the curve: no photograph is HDR, and exposures are not told */
    double spread_before, spread_after; /* rms deviation of log radiance from the mean of its point, all channels */
};

/* Sets exposure, gain and vignette of the training photographs, the vignette of all, starting from their present
 * values, and straightens the pixels of all, once (photograph.is_straight). `faults`: LIGHT_* that may be there; with
 * none only unknown exposures are solved. Gauge: where nothing determines the mean of G, it is 0. The same for any
 * number of threads. */
void calibrate_light(struct scene *scene, const struct views *views, const struct atlas *atlas,
                     const struct inverse_uv *inverse, int faults, struct parallel *pool, struct light_found *found);

#endif
