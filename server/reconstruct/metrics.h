/* metrics.h -- error metrics of a re-render against a photograph.
 *
 * Pictures are R G B, linear radiance, of one size. Pixels with a non-finite value in either do not count; where none
 * is left the metrics are NaN. */
#ifndef UNBAKE_RECONSTRUCT_METRICS_H
#define UNBAKE_RECONSTRUCT_METRICS_H

#include "common/image.h"

/* Mean over pixels and channels of (I - R)^2 / (R^2 + 0.01 m^2), R the photograph's radiance, I
 * the render's, m the median radiance of the training photographs. */
double metrics_msre(const struct image *photograph, const struct image *render, double median_radiance);

/* Expected contribution of noise to that: the mean of d^2 / (R^2 + 0.01 m^2), d the standard deviation of the render's
 * or the photograph's values. */
double metrics_msre_noise(const struct image *photograph, const struct image *deviation, double median_radiance);

/* Peak signal-to-noise ratio in dB of the displayed pictures: sRGB of radiance x exposure, clamped to [0, 1]. Infinite
 * for equal pictures. */
double metrics_psnr_db(const struct image *photograph, const struct image *render, double exposure);

/* Mean structural similarity (Wang et al. 2004) of the same, on luminance, in windows of 8 x 8 valid pixels. */
double metrics_ssim(const struct image *photograph, const struct image *render, double exposure);

#endif
