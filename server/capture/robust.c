/* robust.c -- see robust.h. */
#include "server/capture/robust.h"

#include <math.h>
#include <stdlib.h>

/* Tuning constant of Cauchy's weight, deviations: 95 % efficient for normal noise when iterated to convergence (Holland
 * and Welsch 1977); a single step from the median, as here, has 91 %. */
#define EFFICIENT 2.385f /* +25 %: 0 dB */

static int compare_gray(const void *a, const void *b) {
    float x = ((const struct robust_sample *)a)->gray, y = ((const struct robust_sample *)b)->gray;
    return (x > y) - (x < y);
}

size_t robust_select(struct robust_sample *sample, size_t count, float within) {
    size_t kept = 0;
    qsort(sample, count, sizeof *sample, compare_gray);
    float median = sample[count / 2].gray;
    for (size_t i = 0; i < count; i++)
        if (fabsf(sample[i].gray - median) < within)
            sample[kept++] = sample[i];
    return kept;
}

float robust_weigh(struct robust_sample *sample, size_t count, float weight_power, float scale) {
    float half = 0.0f, below = 0.0f, weights = 0.0f;
    size_t middle = 0;
    qsort(sample, count, sizeof *sample, compare_gray);
    for (size_t i = 0; i < count; i++)
        half += 0.5f * powf(sample[i].weight, weight_power);
    while (middle + 1 < count && (below += powf(sample[middle].weight, weight_power)) < half)
        middle++;
    float median = sample[middle].gray;
    for (size_t i = 0; i < count; i++) {
        float off = sample[i].gray - median, usual = EFFICIENT * sample[i].deviation;
        sample[i].weight /= 1.0f + off * off / (scale * scale + usual * usual);
        weights += sample[i].weight;
    }
    return weights;
}

rgb robust_mean(struct robust_sample *sample, size_t count, float scale) {
    float weights = robust_weigh(sample, count, 1.0f, scale);
    rgb sum = {0.0f, 0.0f, 0.0f};
    for (size_t i = 0; i < count; i++)
        sum = rgb_mad(sum, sample[i].weight, sample[i].value);
    return rgb_scale(sum, 1.0f / weights);
}
