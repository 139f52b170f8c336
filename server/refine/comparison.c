/* comparison.c -- see comparison.h. */
#include "server/refine/comparison.h"

/* Added to the expected radiance in denominators, part of the median radiance: darker places show as much of
 * a lens's stray light. */
#define DIFFERENCE_FLOOR 0.003f /* +25 %: 0 dB */

/* Deviations of noise at which an observation has half its weight. Large: path-traced photographs are rarely much too
 * bright and often a little too dark, so that rejecting the former would darken everything. */
#define NOISE_WIDTH 8.0f /* +25 %: 0 dB */
/* Relative variance of an observation without noise of the photograph: that of a render with few paths. */
#define RENDER_VARIANCE 0.1f /* +25 %: +0.01 dB */

struct comparison comparison_make(const struct photograph_sample *reference, const rgb *radiance, int sample_count,
                                  rgb expected, rgb noise, float median_radiance) {
    float observed[3] = {0}, rendered[3] = {0}, clip[3] = {0};
    bool saturated[3] = {false};
    float each = 1.0f / (float)sample_count;
    for (int s = 0; s < sample_count; s++) {
        const struct photograph_sample *ref = &reference[s];
        const float r[3] = {ref->radiance.r, ref->radiance.g, ref->radiance.b};
        const float i[3] = {radiance[s].r, radiance[s].g, radiance[s].b};
        const float k[3] = {ref->clip_radiance.r, ref->clip_radiance.g, ref->clip_radiance.b};
        for (int c = 0; c < 3; c++) {
            observed[c] += each * r[c];
            rendered[c] += each * i[c];
            clip[c] += each * k[c];
            saturated[c] = saturated[c] || ref->saturated[c];
        }
    }
    struct comparison comparison;
    float residual = 0.0f;
    const float about[3] = {expected.r, expected.g, expected.b}, deviation[3] = {noise.r, noise.g, noise.b};
    for (int c = 0; c < 3; c++) {
        if (saturated[c])
            observed[c] = rendered[c] >= clip[c] ? rendered[c] : clip[c];
        float scale = 1.0f / (about[c] + DIFFERENCE_FLOOR * median_radiance);
        comparison.observed[c] = scale * observed[c];
        comparison.rendered[c] = scale * rendered[c];
        float noise_variance = scale * scale * deviation[c] * deviation[c];
        comparison.channel_weight[c] = RENDER_VARIANCE / (RENDER_VARIANCE + noise_variance);
        residual += (comparison.observed[c] - scale * about[c]) / 3.0f;
    }
    float usual = NOISE_WIDTH * rgb_mean(noise) / (rgb_mean(expected) + DIFFERENCE_FLOOR * median_radiance);
    comparison.weight = 1.0f / (1.0f + residual * residual / (1.0f + usual * usual));
    return comparison;
}
