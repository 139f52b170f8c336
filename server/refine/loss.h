/* loss.h -- how far a render is from a photograph, and the derivative of that.
 *
 * Relative squared error w (I - R)^2 with w = 1 / (mean(R)^2 + 0.01 m^2 + 4 s^2): m is the median
 * radiance of the photographs, s the noise of the stored value (quantisation and photons, 0 for
 * HDR). w depends on the photograph alone, so the gradient from two independent half-estimates A
 * and B, w ((A - R) dB + (B - R) dA), is unbiased at any sample count (Azinovic et al. 2019),
 * which one estimate's is not. A saturated channel is an inequality: it pulls only while the
 * mean of all samples is below the clip. */
#ifndef UNBAKE_REFINE_LOSS_H
#define UNBAKE_REFINE_LOSS_H

#include <stdbool.h>

#include "common/vec.h"
#include "server/scene/photograph.h"

/* Weight of a reference value in the loss, 1 / radiance^2. */
float loss_weight(const struct photograph *photo, const struct photograph_sample *reference,
                  float median_radiance);

/* What one look at a texel compares: sample_count paths of one photograph, even ones half A, odd
 * ones half B; where `one_estimate`, all paths stand for either half, and noise adds to the loss.
 * Writes d_radiance[sample_count], the derivative of the loss by each path's radiance, and returns
 * the unbiased estimate of the loss itself (it may be negative). */
float loss_pair(const struct photograph *photo, const struct photograph_sample *reference,
                const rgb *radiance, int sample_count, bool one_estimate, float median_radiance,
                rgb *d_radiance);

#endif
