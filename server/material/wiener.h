/* wiener.h -- the scales of a noisy picture, each freed of its noise.
 *
 * An undecimated B3 spline wavelet (Starck, Fadili and Murtagh 2007) parts a picture into what differs over 1, 2,
 * 4, ... samples. Of each such detail a Wiener filter (Wiener 1949) keeps the share that is texture: the power around
 * a sample is that of texture plus that of noise, and what noise alone gives is known by a draw of it.
 *
 * All values are kept multiplied by their weights ("normalised convolution", Knutsson and Westin 1993), so that a
 * smoothing is a plain convolution of the planes, whatever is missing. */
#ifndef UNBAKE_MATERIAL_WIENER_H
#define UNBAKE_MATERIAL_WIENER_H

#include <stdbool.h>
#include <stddef.h>

/* The value by channel; a draw of its noise; the variance of what neighbours share of it, which no draw tells; the
 * weight, by which all others are multiplied. */
enum { WIENER_VALUE, WIENER_NOISE = WIENER_VALUE + 3, WIENER_MIXING = WIENER_NOISE + 3, WIENER_WEIGHT, WIENER_PLANES };

/* A picture, and room for its filters. All planes are [height][width] and owned. */
struct wiener {
    size_t width, height;
    bool *inside;                 /* samples that tell of power; what is kept is told of these alone */
    float *plane[WIENER_PLANES];  /* the picture, smoother after each level */
    float *kept[3];               /* by channel: the sum of what was kept so far */
    float *coarse[WIENER_PLANES]; /* scratch, as all below */
    float *power, *bounded_power, *noise_power, *weight_sum, *count;
    float *scratch;
};

/* Room for `samples` of them; width and height are to be set, with width * height <= samples. */
void wiener_init(struct wiener *w, size_t samples);
void wiener_release(struct wiener *w);

/* Takes `levels` levels out of the picture, the first of `step` samples, each of twice the one before, and adds
 * what is texture of them to `kept`. Power is averaged over no more than window_most samples to either side. */
void wiener_levels(struct wiener *w, size_t step, int levels, size_t window_most);

/* How far the filters of a call read, samples. */
size_t wiener_reach(size_t step, int levels, size_t window_most);

#endif
