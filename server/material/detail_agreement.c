/* detail_agreement.c -- see detail_agreement.h. */
#include "server/material/detail_agreement.h"

#include <math.h>

#include "common/mem.h"
#include "server/capture/split_half.h"
#include "server/material/detail_pixels.h"
#include "server/scene/rgb_half.h"

/* Splits of the photographs into halves; a split counts for a texel if the lesser half has this part of its weight. */
#define SPLITS 4       /* +25 %: +0.01 dB */
#define MIN_HALF 0.15f /* +25 %: +0.01 dB */
/* Radius over which the halves' agreement is averaged, texels. */
#define AGREEMENT_RADIUS 4 /* +25 %: +0.02 dB */
/* Halves of noise alone agree by chance, in a window by some .3 of its variance (a standard deviation): this part of
 * the variance that the photographs' noise is expected to have is taken off what halves have in common. .1: error of
 * test_detail's noisy tiles .0355 to .0373; 1: its waves .0157 to .0182. */
#define CHANCE 0.25
/* Weight of the halves' disagreement as noise: it is low because most of it is a difference of sharpness. */
#define DISAGREEMENT 0.04f /* +25 %: +0.01 dB */
#define MIN_SHARE 0.05f    /* a lower share counts as 0; +25 %: 0 dB */
/* Scales of the integer sums: COUNT_SCALE until the greatest sum of weights is known, then the largest that cannot
 * overflow. Weights differ by orders of magnitude: with a coarse scale the least are lost, and steps are too long. */
#define COUNT_SCALE 4096.0f /* +25 %: 0 dB */
#define MAX_SUM 1e9f        /* +25 %: 0 dB */

enum { WEIGHT, RESIDUAL, NOISE }; /* the sums in use here: weights, weighted residuals, variance of these */
#define ALL_PHOTOGRAPHS (-1)      /* in place of a split */

/* Adds each pixel's weight and weighted residual to the texels of its footprint. */
static void weigh_row(void *user, size_t row, int thread) {
    (void)thread;
    const struct detail_picture *job = user;
    struct detail *d = job->detail;
    uint32_t width = job->width, train = job->train;
    struct footprint_texels t;
    detail_pixels_use(d, train, row);
    for (uint32_t x = 0; x < width; x++) {
        size_t at = row * width + x;
        if (!detail_pixels_footprint(d, train, x, (uint32_t)row, d->triangle[train][at], &t))
            continue;
        float residual = rgb_mean(rgb_from_half(d->residual[train][at])), weight = d->sum_scale * d->weight[train][at];
        for (size_t i = 0; i < t.count; i++) {
            detail_add(&d->sum[t.texel[i]][WEIGHT], weight * t.share[i]);
            detail_add(&d->sum[t.texel[i]][RESIDUAL], weight * t.share[i] * residual);
            detail_add(&d->sum[t.texel[i]][NOISE], weight * t.share[i] * t.share[i]);
        }
    }
}

/* Sums over all photographs, or over those of the first half of a split. */
static void sum_weighted(struct detail *d, int split, float scale) {
    detail_clear_sums(d);
    d->sum_scale = scale;
    for (uint32_t t = 0; t < d->in.views->train_count; t++)
        if (split == ALL_PHOTOGRAPHS || split_half_of(t, split) == 0)
            detail_pixels_rows(d, t, weigh_row);
}

/* Sums over the splits: the square of a texel's mean residual, the product of the halves' mean residuals, and the
 * variance that the photographs' noise is expected to make of the mean residual. */
struct agreement {
    float square, common, noise;
};

struct agreement_job {
    struct detail *detail;
    float *residual;             /* [height][width] the sum over all photographs */
    float *noise;                /* [height][width] expected variance of the mean residual of all */
    struct agreement *agreement; /* [height][width] */
};

static double scaled(const struct detail *d, size_t texel, int sum) {
    return (double)d->sum[texel][sum] / (double)d->sum_scale;
}

/* Adds one split, where both halves have enough weight. */
static void agree_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct agreement_job *a = user;
    const struct detail *d = a->detail;
    const struct inverse_uv *inverse = d->in.surface.inverse;
    for (size_t i = chunk * DETAIL_CHUNK; i < (chunk + 1) * DETAIL_CHUNK && i < inverse->valid_count; i++) {
        uint32_t texel = inverse->valid[i];
        double all = (double)d->weight_sum[texel];
        double weight[2] = {scaled(d, texel, WEIGHT)}, residual[2] = {scaled(d, texel, RESIDUAL)};
        weight[1] = all - weight[0];
        residual[1] = (double)a->residual[texel] - residual[0];
        if (!(all > 0.0) || fmin(weight[0], weight[1]) < MIN_HALF * all)
            continue;
        double mean = (double)a->residual[texel] / all;
        a->agreement[texel].square += (float)(mean * mean);
        a->agreement[texel].common += (float)(residual[0] / weight[0] * (residual[1] / weight[1]));
        a->agreement[texel].noise += a->noise[texel];
    }
}

/* Share of a texel's residual that is not noise. */
static float signal_share_of(const struct agreement_job *a, uint32_t texel) {
    const struct detail *d = a->detail;
    long width = (long)d->in.surface.inverse->width, height = (long)d->in.surface.inverse->height;
    long x0 = (long)texel % width, y0 = (long)texel / width;
    double square = 0.0, common = 0.0, expected = 0.0;
    if (!(a->agreement[texel].square > 0.0f))
        return 0.0f;
    for (long y = y0 - AGREEMENT_RADIUS; y <= y0 + AGREEMENT_RADIUS; y++) {
        for (long x = x0 - AGREEMENT_RADIUS; x <= x0 + AGREEMENT_RADIUS; x++) {
            size_t at = (size_t)(y * width + x);
            if (x < 0 || y < 0 || x >= width || y >= height || d->chart_of_texel[at] != d->chart_of_texel[texel])
                continue;
            square += (double)a->agreement[at].square;
            common += (double)a->agreement[at].common;
            expected += (double)a->agreement[at].noise;
        }
    }
    double noise = DISAGREEMENT * fmax(square - common, 0.0), signal = common - CHANCE * expected;
    float share = signal > 0.0 ? (float)(signal / (signal + noise)) : 0.0f;
    return share < MIN_SHARE ? 0.0f : share;
}

static void share_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct agreement_job *a = user;
    struct detail *d = a->detail;
    const struct inverse_uv *inverse = d->in.surface.inverse;
    for (size_t i = chunk * DETAIL_CHUNK; i < (chunk + 1) * DETAIL_CHUNK && i < inverse->valid_count; i++)
        if (d->chart_of_texel[inverse->valid[i]] != DETAIL_NONE)
            d->signal_share[inverse->valid[i]] = signal_share_of(a, inverse->valid[i]);
}

/* Sums the weights of each texel, and chooses the scale of sums by the greatest. */
static void sum_weights(struct detail *d) {
    float most = 0.0f;
    sum_weighted(d, ALL_PHOTOGRAPHS, COUNT_SCALE);
    for (size_t i = 0; i < d->in.surface.inverse->valid_count; i++)
        most = fmaxf(most, (float)scaled(d, d->in.surface.inverse->valid[i], WEIGHT));
    sum_weighted(d, ALL_PHOTOGRAPHS, MAX_SUM / fmaxf(most, 1.0f));
    for (size_t i = 0; i < d->in.surface.inverse->valid_count; i++)
        d->weight_sum[d->in.surface.inverse->valid[i]] = (float)scaled(d, d->in.surface.inverse->valid[i], WEIGHT);
}

void detail_agreement_find(struct detail *d) {
    size_t texels = (size_t)d->in.surface.inverse->width * d->in.surface.inverse->height;
    sum_weights(d);
    struct agreement_job a = {.detail = d,
                              .residual = mem_calloc_large(texels, sizeof *a.residual),
                              .noise = mem_calloc_large(texels, sizeof *a.noise),
                              .agreement = mem_calloc_large(texels, sizeof *a.agreement)};
    for (size_t i = 0; i < d->in.surface.inverse->valid_count; i++) {
        uint32_t texel = d->in.surface.inverse->valid[i];
        double weight = (double)d->weight_sum[texel];
        a.residual[texel] = (float)scaled(d, texel, RESIDUAL);
        a.noise[texel] =
            weight > 0.0 ? (float)((double)d->variance * scaled(d, texel, NOISE) / (weight * weight)) : 0.0f;
    }
    for (int split = 0; split < SPLITS; split++) {
        sum_weighted(d, split, d->sum_scale);
        parallel_for(d->in.pool, detail_chunks(d), agree_chunk, &a);
    }
    parallel_for(d->in.pool, detail_chunks(d), share_chunk, &a);
    mem_free(a.agreement);
    mem_free(a.noise);
    mem_free(a.residual);
}
