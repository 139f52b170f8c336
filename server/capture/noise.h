/* noise.h -- noise of a capture's pixels, measured from the photographs.
 *
 * Where three adjacent pixels show one smooth surface, the middle one differs from the mean of the others by noise
 * alone; the difference is small over most of any picture, so a low quantile measures noise and not texture. Noise is
 * kept as a share of the stored value (exposure x radiance), for each octave of that value: for photon noise and for a
 * renderer's samples the share only falls as the value rises. It also varies over the picture (a renderer converges
 * worse in one corner, a camera's processing smooths another): for each block, texture is separated from noise by the
 * growth of the difference with pixel distance. The limit at distance 0, the nugget of a variogram (Matheron 1963), is
 * noise.
 *
 * The darkest 8-bit values whose noise is measurable give its deviation at black, below which it does not fall. */
#ifndef UNBAKE_CAPTURE_NOISE_H
#define UNBAKE_CAPTURE_NOISE_H

#include "common/parallel.h"
#include "common/vec.h"
#include "server/capture/views.h"

#define NOISE_OCTAVES 40 /* octaves of stored values: from 2^-24, the smallest half, to 2^16, the largest */
/* Pixels a side: up to 768 differences, whose median is off by 4 %; +25 %: +0.01 dB. */
#define NOISE_BLOCK 16

struct noise {
    float share[NOISE_OCTAVES]; /* standard deviation over value, for each octave */
    float black;                /* of 8-bit photographs; see photograph.h */
    size_t train_count;
    float **scale; /* [train_count][rows][columns] factor to the share in each block of a photograph; owned */
};

void noise_measure(struct noise *noise, const struct views *views, struct parallel *pool);
/* Sets `black` of the 8-bit training photographs. */
void noise_set_black(const struct noise *noise, struct scene *scene);
void noise_release(struct noise *noise);

/* Standard deviation of the radiance read at the view's position, where the true radiance is `radiance`. Above 0 where
 * that is. */
rgb noise_deviation(const struct noise *noise, const struct views *views, const struct view *view, rgb radiance);

/* The same for a stored value at a position of a picture. */
float noise_deviation_of_value(const struct noise *noise, uint32_t train, const struct camera *camera, float x, float y,
                               float value);

/* Standard deviation of a black pixel; of 8-bit photographs. */
float noise_deviation_of_black(const struct noise *noise);

/* Weight of a look-up there among others of the same point with true radiance `radiance`: the inverse of its relative
 * variance, from noise and from light of other surfaces (views_mixing). */
float noise_weight(const struct noise *noise, const struct views *views, const struct view *view, rgb radiance,
                   float mixing);

/* The same by brightness alone, without block factors and light of other surfaces: fine texture partly counts as noise
 * in blocks. */
float noise_weight_of_brightness(const struct noise *noise, const struct photograph *photo, rgb radiance);

/* A bilinear or cubic look-up at the view's position in a picture of independent noise of deviation 1. The same for the
 * same pixels, so texels that share pixels share their noise. */
float noise_draw(const struct view *view, bool cubic);

#endif
