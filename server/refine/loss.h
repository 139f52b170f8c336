/* loss.h -- the loss of an observation, and its derivative.
 *
 * Relative squared error w (I - R)^2 of render I and photograph R, w = 1 / (mean(R)^2 + 0.01 m^2 + 4 s^2): m is the
 * median radiance of the photographs, s the noise of the stored value (quantisation and photons, 0 for HDR). w depends
 * on the photograph alone, so the gradient from two independent half-estimates A and B, w ((A - R) dB + (B - R) dA), is
 * unbiased at any sample count (Azinovic et al. 2019); one estimate's is not. A saturated channel is an inequality
 * constraint: its residual is 0 once the mean of all samples reaches the clip. */
#ifndef UNBAKE_REFINE_LOSS_H
#define UNBAKE_REFINE_LOSS_H

#include <stdbool.h>

#include "common/vec.h"
#include "server/scene/photograph.h"

/* Weight of a reference value in the loss, 1 / radiance^2. */
float loss_weight(const struct photograph *photo, const struct photograph_sample *reference, float median_radiance);

/* Loss of one observation with sample_count paths, even ones half A, odd ones half B; with `one_estimate` all paths are
 * used for both halves, and noise adds to the loss. Writes d_radiance[sample_count], the derivative of the loss by each
 * path's radiance, and returns the unbiased estimate of the loss (it may be negative). */
float loss_pair(const struct photograph *photo, const struct photograph_sample *reference, const rgb *radiance,
                int sample_count, bool one_estimate, float median_radiance, rgb *d_radiance);

#endif
