/* match.c -- see match.h. */
#include "server/refine/match.h"

#include <math.h>

/* Share of the median radiance below which a relative difference counts for less. */
#define DIFFERENCE_FLOOR 0.003f

/* So many deviations of noise off a look still has half its trust. Were it few, what is rarely much too bright, as
 * photographs of a renderer are, would count for less than what is often a little too dark, and all would darken. */
#define NOISE_WIDTH 8.0f
/* What one look is off by even without noise of the photograph, as a variance: it is rendered with few paths. */
#define LOOK_VARIANCE 0.1f

struct match match_look(const struct photograph_sample *reference, const rgb *radiance,
                        int sample_count, rgb expected, rgb noise, float median_radiance) {
    float shown[3] = {0}, rendered[3] = {0}, clip[3] = {0};
    bool saturated[3] = {false};
    float each = 1.0f / (float)sample_count;
    for (int s = 0; s < sample_count; s++) {
        const struct photograph_sample *ref = &reference[s];
        const float r[3] = {ref->radiance.r, ref->radiance.g, ref->radiance.b};
        const float i[3] = {radiance[s].r, radiance[s].g, radiance[s].b};
        const float k[3] = {ref->clip_radiance.r, ref->clip_radiance.g, ref->clip_radiance.b};
        for (int c = 0; c < 3; c++) {
            shown[c] += each * r[c];
            rendered[c] += each * i[c];
            clip[c] += each * k[c];
            saturated[c] = saturated[c] || ref->saturated[c];
        }
    }
    struct match match;
    float off = 0.0f;
    const float about[3] = {expected.r, expected.g, expected.b}, deviation[3] = {noise.r, noise.g, noise.b};
    for (int c = 0; c < 3; c++) {
        if (saturated[c])
            shown[c] = rendered[c] >= clip[c] ? rendered[c] : clip[c];
        float scale = 1.0f / (about[c] + DIFFERENCE_FLOOR * median_radiance);
        match.shown[c] = scale * shown[c];
        match.rendered[c] = scale * rendered[c];
        match.worth[c] = LOOK_VARIANCE / (LOOK_VARIANCE + scale * scale * deviation[c] * deviation[c]);
        off += (match.shown[c] - scale * about[c]) / 3.0f;
    }
    float usual = NOISE_WIDTH * rgb_mean(noise) / (rgb_mean(expected) + DIFFERENCE_FLOOR * median_radiance);
    match.trust = 1.0f / (1.0f + off * off / (1.0f + usual * usual));
    return match;
}
