/* metrics.h -- error metrics of a re-render against a photograph, free of the re-render's own noise.
 *
 * Photographs are R G B, linear radiance; re-renders two independent ones of the same size, channels a.R a.G a.B b.R
 * b.G b.B (film_render_halves). The square of an error is taken as the product of those of a and b: noise, which is
 * independent in them, adds nothing to its mean. What is left of it is how much the mean varies: the standard error,
 * which comes from half of the sum and the difference d of both errors, s: the variance of (s + d/2) (s - d/2) is the
 * mean of s^2 d^2 where the noise is Gaussian. A product's mean may be negative where there is hardly any error.
 *
 * Pixels with a non-finite value in any do not count; where none is left the metrics are NaN. */
#ifndef UNBAKE_RECONSTRUCT_METRICS_H
#define UNBAKE_RECONSTRUCT_METRICS_H

#include "common/image.h"

struct metric {
    double value;
    double noise; /* standard error of it by the re-renders' noise */
};

/* Mean over pixels and channels of (A - R) (B - R) / (R^2 + 0.01 m^2), R the photograph's radiance, A and B those of
 * the re-renders, m the median radiance of the training photographs. */
struct metric metrics_msre(const struct image *photograph, const struct image *halves, double median_radiance);

/* What noise adds to the same of one picture: of the mean of both re-renders, by their difference; and of a photograph,
 * by the standard deviation d of its pixels (R G B): the mean of d^2 / (R^2 + 0.01 m^2). */
double metrics_msre_of_renders(const struct image *photograph, const struct image *halves, double median_radiance);
double metrics_msre_of_photograph(const struct image *photograph, const struct image *deviation,
                                  double median_radiance);

/* Square of the logarithm of the mean radiance of a re-render over that of the photograph; negative where noise is more
 * than that. NaN also where either is not positive. */
double metrics_brightness_error(const struct image *photograph, const struct image *halves);

/* Peak signal-to-noise ratio in dB of the displayed pictures: sRGB of radiance x exposure, clamped to [0, 1]. Infinite
 * for equal pictures. Where the mean squared error is below its own standard error it is taken for that: then the ratio
 * is at least what is returned. */
struct metric metrics_psnr_db(const struct image *photograph, const struct image *halves, double exposure);

/* Mean structural similarity (Wang et al. 2004) of the same, on luminance, in windows of 8 x 8 valid pixels; variances
 * of the re-render are covariances of both. */
double metrics_ssim(const struct image *photograph, const struct image *halves, double exposure);

#endif
