/* denoise.h -- base colour without the photographs' noise, and in-fill where nothing was measured.
 *
 * A Wiener filter (Wiener 1949) on an undecimated B3 spline wavelet (Starck, Fadili and Murtagh
 * 2007) of each chart. At every scale the power around a texel is that of texture plus that of
 * noise. What noise alone gives is known: the same look-ups with the same weights were made in
 * pictures of pure noise (noise.h), so whatever correlates the noise of neighbouring texels is
 * accounted for; and how much noise there is beyond what the pictures as a whole have is told by how far
 * photographs of the same texels differ. Detail is kept by its share of texture: walls become flat, wood keeps its grain.
 * The weight of a texel tells how noisy it is beside its neighbours; one of weight 0 is filled in
 * from them, and a chart of which nothing is known from its prior. Nothing crosses the border of a
 * chart, so nothing crosses that of a segment. */
#ifndef UNBAKE_RECONSTRUCT_DENOISE_H
#define UNBAKE_RECONSTRUCT_DENOISE_H

#include <stdint.h>

#include "common/image.h"
#include "common/parallel.h"
#include "common/vec.h"
#include "server/scene/atlas.h"
#include "server/scene/inverse_uv.h"
#include "server/scene/texture.h"

/* What was measured of a texel; half precision but for the weight, since there may be many millions.
 * Variances and draws are those of the sum over the channels. */
struct measured {
    float weight;           /* inverse variance, up to a factor of the capture; 0: nothing was measured */
    uint16_t value[3];
    uint16_t noise;         /* a draw of the photographs' noise */
    uint16_t light_noise;   /* a draw of the error of what the photographs were divided by */
    uint16_t mixing;        /* variance by light of other surfaces; neighbours share it */
    uint16_t spread;        /* variance of what photographs show of it, about their mean */
    uint16_t noise_spread;  /* the same of the draws of their noise */
};

static inline rgb measured_value(const struct measured *m) {
    return rgb_make(image_float_from_half(m->value[0]), image_float_from_half(m->value[1]),
                    image_float_from_half(m->value[2]));
}

/* What is known of a chart's colour before its texels are looked at. */
struct color_prior {
    rgb mean;
    float variance; /* of texels about the mean, summed over the channels */
};

/* Writes the valid texels of `out` from measured[height][width] and prior[chart_count]. The same for any
 * number of threads. */
void denoise(const struct atlas *atlas, const struct inverse_uv *inverse, size_t triangle_count,
             const struct measured *measured, const struct color_prior *prior, struct texture *out,
             struct parallel *pool);

#endif
