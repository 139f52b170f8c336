/* wiener.h -- multi-scale Wiener filter of a noisy picture with missing samples.
 *
 * B3 splines of 1, 2, 4, ... samples (Starck, Fadili and Murtagh 2007) split a picture into bands of three octaves. Of
 * each band's details a Wiener filter (Wiener 1949) keeps the share that is texture (patch_spectrum.h); noise power is
 * measured on a sample of the noise.
 *
 * Values are stored multiplied by their weights (normalised convolution, Knutsson and Westin 1993), so that smoothing
 * is a plain convolution of the planes, whatever is missing. */
#ifndef UNBAKE_MATERIAL_WIENER_H
#define UNBAKE_MATERIAL_WIENER_H

#include <stdbool.h>
#include <stddef.h>

/* Value by channel; a sample of its noise; variance of the error that neighbours share, which that sample lacks;
 * variance of the noise up to a factor; the weight, by which all others are multiplied. */
enum {
    WIENER_VALUE,
    WIENER_NOISE = WIENER_VALUE + 3,
    WIENER_MIXING = WIENER_NOISE + 3,
    WIENER_VARIANCE,
    WIENER_WEIGHT,
    WIENER_PLANES
};

#define WIENER_OCTAVES 3 /* of a band */

/* A picture, and room for its filters. All planes are [height][width] and owned. */
struct wiener {
    size_t width, height;
    bool *inside;                /* samples that count; only these are filtered */
    float *plane[WIENER_PLANES]; /* the picture; after each band its low-pass */
    float *kept[3];              /* by channel: sum of the filtered details so far */
    float *error;                /* expected squared error of these, summed over channels and bands */
    float *fine[WIENER_PLANES], *coarse[WIENER_PLANES]; /* scratch, as all below */
    float *power, *bounded_power, *noise_power, *relative_noise, *weight_sum, *count;
    float *trust, *variance, *mixing, *filled, *outliers, *scratch;
};

/* Room for `samples` of them; width and height are to be set, with width * height <= samples. */
void wiener_init(struct wiener *w, size_t samples);
void wiener_release(struct wiener *w);

/* Filters the band of `octaves` (up to WIENER_OCTAVES) whose finest has a step of `step` samples, and adds its texture
 * to `kept` and what that is off to `error`. Nothing finer than `resolution` samples was resolved. */
void wiener_band(struct wiener *w, size_t step, int octaves, size_t resolution);

/* Radius of the samples that such a call reads: of a whole band. */
size_t wiener_reach(size_t step);

#endif
