/* robust.c -- see robust.h. */
#include "server/reconstruct/robust.h"

#include <stdlib.h>

static int compare_gray(const void *a, const void *b) {
    float x = ((const struct robust_sample *)a)->gray, y = ((const struct robust_sample *)b)->gray;
    return (x > y) - (x < y);
}

rgb robust_mean(struct robust_sample *sample, size_t count, float scale) {
    qsort(sample, count, sizeof *sample, compare_gray);
    float half = 0.0f, below = 0.0f;
    for (size_t i = 0; i < count; i++)
        half += 0.5f * sample[i].weight;
    size_t middle = 0;
    while (middle + 1 < count && (below += sample[middle].weight) < half)
        middle++;
    rgb sum = {0.0f, 0.0f, 0.0f};
    float weights = 0.0f;
    for (size_t i = 0; i < count; i++) {
        float off = (sample[i].gray - sample[middle].gray) / scale;
        float w = sample[i].weight / (1.0f + off * off);
        sum = rgb_mad(sum, w, sample[i].value);
        weights += w;
    }
    return rgb_scale(sum, 1.0f / weights);
}
