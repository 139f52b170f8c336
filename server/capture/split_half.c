/* split_half.c -- see split_half.h. */
#include "server/capture/split_half.h"

#include <math.h>

#include "common/rng.h"

/* Samples less sharp than this share of the sharpest are left out of the halves, unless nothing else is there: their
 * lost texture would count as noise. Sharpness is pixels by area: .3 is 1.8 times the distance. */
#define SHARPNESS_SHARE 0.3f /* +25 %: -0.05 dB */
/* Splits are tried until the lighter half has this share of the weight: the difference of the halves then has at most
 * 4/3 of the variance of an even split's. */
#define BALANCED_SHARE 0.25f /* +25 %: +0.01 dB */

/* A weighted mean and its expected variance. */
struct half_mean {
    float weight, variance;
    rgb value;
};

static void add(struct half_mean *m, const struct robust_sample *s) {
    m->weight += s->weight;
    m->value = rgb_mad(m->value, s->weight, s->value);
    m->variance += s->weight * s->weight * s->deviation * s->deviation;
}

static void finish(struct half_mean *m) {
    m->value = rgb_scale(m->value, 1.0f / m->weight);
    m->variance /= m->weight * m->weight;
}

int split_half_of(uint32_t source, int split) { return (int)(rng_mix64(source) >> split & 1); }

/* The share of the weight that the lighter half has. */
static float lesser_share(const struct robust_sample *sample, size_t count, float min_sharp, int split) {
    float weight[2] = {0.0f, 0.0f};
    for (size_t i = 0; i < count; i++) {
        if (sample[i].sharp >= min_sharp)
            weight[split_half_of(sample[i].source, split)] += sample[i].weight;
    }
    return fminf(weight[0], weight[1]) / (weight[0] + weight[1]);
}

/* The draw from samples of at least this sharpness. */
static bool draw_from(const struct robust_sample *sample, size_t count, float min_sharp, rgb *draw) {
    const struct half_mean none = {.weight = 0.0f};
    struct half_mean all = none, half[2] = {none, none};
    float best = 0.0f;
    int split = 0;
    for (int w = 0; w < SPLIT_HALF_SPLITS && best < BALANCED_SHARE; w++) {
        float share = lesser_share(sample, count, min_sharp, w);
        if (share > best)
            best = share, split = w;
    }
    if (!(best > 0.0f))
        return false;
    for (size_t i = 0; i < count; i++) {
        add(&all, &sample[i]);
        if (sample[i].sharp >= min_sharp)
            add(&half[split_half_of(sample[i].source, split)], &sample[i]);
    }
    finish(&all);
    finish(&half[0]);
    finish(&half[1]);
    float variance = half[0].variance + half[1].variance;
    if (!(variance > 0.0f))
        return false;
    *draw = rgb_scale(rgb_sub(half[1].value, half[0].value), sqrtf(all.variance / variance));
    return true;
}

bool split_half_draw(const struct robust_sample *sample, size_t count, rgb *draw) {
    float sharpest = 0.0f;
    for (size_t i = 0; i < count; i++)
        sharpest = fmaxf(sharpest, sample[i].sharp);
    return draw_from(sample, count, SHARPNESS_SHARE * sharpest, draw) || draw_from(sample, count, 0.0f, draw);
}
