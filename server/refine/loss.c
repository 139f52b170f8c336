/* loss.c -- see loss.h. */
#include "server/refine/loss.h"

#include <math.h>

/* Shot noise: variance of a stored linear value v is about PHOTON_VARIANCE * v for a consumer camera at its base
 * sensitivity (full well about 10^4 electrons). */
#define PHOTON_VARIANCE 1e-4f /* +25 %: no change */

/* Variance of the stored linear value v of an 8-bit sRGB frame. */
static float stored_variance(float v) {
    /* Slope of the sRGB decoding curve at v, times one code, over the standard deviation of a
     * uniform error of one code. */
    float encoded_slope = v < 0.0031308f ? 1.0f / 12.92f : 2.275f * powf(v, 1.4f / 2.4f);
    float step = encoded_slope / 255.0f;
    return step * step / 12.0f + PHOTON_VARIANCE * v;
}

float loss_weight(const struct photograph *photo, const struct photograph_sample *reference, float median_radiance) {
    float mean = rgb_mean(reference->radiance);
    float variance = 0.0f;
    if (!photo->is_hdr) {
        float scale = photo->exposure * rgb_mean(photo->gain);
        variance = stored_variance(fmaxf(mean * scale, 0.0f)) / (scale * scale);
    }
    return 1.0f / (mean * mean + 0.01f * median_radiance * median_radiance + 4.0f * variance);
}

/* Difference of one channel's half-estimate from the reference; `all` is the mean of all samples. */
static float residual(float half, float all, float reference, bool saturated, float clip) {
    if (!saturated)
        return half - reference;
    return all >= clip ? 0.0f : half - clip;
}

float loss_pair(const struct photograph *photo, const struct photograph_sample *reference, const rgb *radiance,
                int sample_count, bool one_estimate, float median_radiance, rgb *d_radiance) {
    rgb half[2] = {{0, 0, 0}, {0, 0, 0}}, target = {0, 0, 0}, clip = {0, 0, 0};
    bool saturated[3] = {false};
    int count[2] = {(sample_count + 1) / 2, sample_count / 2};
    float weight = 0.0f;
    for (int s = 0; s < sample_count; s++) {
        half[s & 1] = rgb_add(half[s & 1], radiance[s]);
        target = rgb_add(target, reference[s].radiance);
        clip = rgb_add(clip, reference[s].clip_radiance);
        for (int c = 0; c < 3; c++)
            saturated[c] = saturated[c] || reference[s].saturated[c];
        weight += loss_weight(photo, &reference[s], median_radiance);
    }
    float each = 1.0f / (float)sample_count;
    rgb all = rgb_scale(rgb_add(half[0], half[1]), each);
    half[0] = one_estimate ? all : rgb_scale(half[0], 1.0f / (float)count[0]);
    half[1] = one_estimate ? all : rgb_scale(half[1], 1.0f / (float)count[1]);
    target = rgb_scale(target, each);
    clip = rgb_scale(clip, each);
    weight *= each;
    rgb difference[2];
    for (int h = 0; h < 2; h++) {
        difference[h].r = residual(half[h].r, all.r, target.r, saturated[0], clip.r);
        difference[h].g = residual(half[h].g, all.g, target.g, saturated[1], clip.g);
        difference[h].b = residual(half[h].b, all.b, target.b, saturated[2], clip.b);
    }
    for (int s = 0; s < sample_count; s++)
        d_radiance[s] = rgb_scale(difference[1 - (s & 1)], weight / (float)count[s & 1]);
    return weight * 3.0f * rgb_mean(rgb_mul(difference[0], difference[1]));
}
