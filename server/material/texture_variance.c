/* texture_variance.c -- see texture_variance.h. */
#include "server/material/texture_variance.h"

#include <math.h>
#include <string.h>

#include "common/image.h"
#include "common/mem.h"

#define ROUNDS 4           /* of the fixed point */
#define GREAT_TEXTURE 1.0f /* from which these start: first all texels count much alike */
/* Split halves understate noise by 1.1 to 1.4 (plain walls of passage and staircase2). */
#define NOISE_UNDERSTATED 1.25
#define MIN_TEXTURE 1e-6 /* .0006 of a channel */

struct chart_sums {
    double value[3], squares, noise, weight;
};

static struct chart_sums *sums_of(const struct atlas *atlas, const struct inverse_uv *inverse,
                                  const struct measurement *measured, const struct texture_variance *variance) {
    struct chart_sums *sums = mem_calloc(atlas->chart_count, sizeof *sums);
    for (size_t i = 0; i < inverse->valid_count; i++) {
        const struct measurement *m = &measured[inverse->valid[i]];
        uint32_t chart = atlas->chart_of_triangle[inverse->triangle[inverse->valid[i]]];
        if (!(m->weight > 0.0f))
            continue;
        struct chart_sums *s = &sums[chart];
        double noise = (double)(texture_variance_noise(&variance[chart], m->weight) + image_float_from_half(m->mixing));
        double weight = 1.0 / (noise + (double)variance[chart].texture);
        rgb value = measurement_value(m);
        for (int c = 0; c < 3; c++)
            s->value[c] += weight * (double)(&value.r)[c];
        s->squares += weight * (double)rgb_dot(value, value);
        s->noise += weight * noise;
        s->weight += weight;
    }
    return sums;
}

/* Mean of the weighted squares of the noise's samples. */
static void find_noise(const struct atlas *atlas, const struct inverse_uv *inverse, const struct measurement *measured,
                       struct texture_variance *variance) {
    double(*sum)[2] = mem_calloc(atlas->chart_count, sizeof *sum);
    for (size_t i = 0; i < inverse->valid_count; i++) {
        const struct measurement *m = &measured[inverse->valid[i]];
        rgb noise = rgb_from_half(m->noise);
        double *s = sum[atlas->chart_of_triangle[inverse->triangle[inverse->valid[i]]]];
        s[0] += m->weight > 0.0f ? (double)(m->weight * rgb_dot(noise, noise)) : 0.0;
        s[1] += m->weight > 0.0f ? 1.0 : 0.0;
    }
    for (size_t i = 0; i < atlas->chart_count; i++)
        variance[i].noise = sum[i][1] > 0.0 ? (float)(sum[i][0] / sum[i][1]) : 0.0f;
    mem_free(sum);
}

struct texture_variance *texture_variances(const struct atlas *atlas, const struct inverse_uv *inverse,
                                           const struct measurement *measured) {
    struct texture_variance *variance = mem_calloc(atlas->chart_count, sizeof *variance);
    find_noise(atlas, inverse, measured, variance);
    for (size_t i = 0; i < atlas->chart_count; i++)
        variance[i].texture = GREAT_TEXTURE;
    for (int round = 0; round < ROUNDS; round++) {
        struct chart_sums *sums = sums_of(atlas, inverse, measured, variance);
        for (size_t i = 0; i < atlas->chart_count; i++) {
            const struct chart_sums *s = &sums[i];
            if (!(s->weight > 0.0))
                continue;
            double spread = s->squares;
            for (int c = 0; c < 3; c++)
                spread -= s->value[c] * s->value[c] / s->weight;
            variance[i].texture = (float)fmax((spread - NOISE_UNDERSTATED * s->noise) / s->weight, MIN_TEXTURE);
        }
        mem_free(sums);
    }
    return variance;
}
