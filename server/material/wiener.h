/* wiener.h -- multi-scale Wiener filter of a noisy picture with missing samples.
 *
 * An undecimated B3 spline wavelet (Starck, Fadili and Murtagh 2007) splits a picture into details at scales of 1, 2,
 * 4, ... samples. A Wiener filter (Wiener 1949) keeps of each detail its share of texture: local power is that of
 * texture plus that of noise, and noise power is measured on a sample of the noise.
 *
 * Values are stored multiplied by their weights (normalised convolution, Knutsson and Westin 1993), so that smoothing
 * is a plain convolution of the planes, whatever is missing. */
#ifndef UNBAKE_MATERIAL_WIENER_H
#define UNBAKE_MATERIAL_WIENER_H

#include <stdbool.h>
#include <stddef.h>

/* Value by channel; a sample of its noise; variance of the error that neighbours share, which that sample lacks; the
 * weight, by which all others are multiplied. */
enum { WIENER_VALUE, WIENER_NOISE = WIENER_VALUE + 3, WIENER_MIXING = WIENER_NOISE + 3, WIENER_WEIGHT, WIENER_PLANES };

/* A picture, and room for its filters. All planes are [height][width] and owned. */
struct wiener {
    size_t width, height;
    bool *inside;                 /* samples that count; only these are filtered */
    float *plane[WIENER_PLANES];  /* the picture; after each level its low-pass */
    float *kept[3];               /* by channel: sum of the filtered details so far */
    float *error;                 /* expected squared error of these, summed over channels and levels */
    float *coarse[WIENER_PLANES]; /* scratch, as all below */
    float *power, *bounded_power, *noise_power, *weight_sum, *count;
    float *scratch;
};

/* Room for `samples` of them; width and height are to be set, with width * height <= samples. */
void wiener_init(struct wiener *w, size_t samples);
void wiener_release(struct wiener *w);

/* Filters `levels` levels, the first with a step of `step` samples, each with twice the step of the one before, and
 * adds their texture to `kept` and what that is off to `error`. The radius of the power window is at most max_window
 * samples. Nothing finer than `resolution` samples was resolved. */
void wiener_levels(struct wiener *w, size_t step, int levels, size_t max_window, size_t resolution);

/* Radius of the samples that such a call reads. */
size_t wiener_reach(size_t step, int levels, size_t max_window);

#endif
