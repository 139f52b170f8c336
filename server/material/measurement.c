/* measurement.c -- see measurement.h. */
#include "server/material/measurement.h"

#include "common/image.h"
#include "server/capture/split_half.h"

/* Exponent of the weights for the robust median: one sharp observation of a highlight must not outvote all others. */
#define TRUST 0.5f /* +25 %: -0.02 dB */

struct measurement measurement_mean(struct measurement_observations *observations, float scale, rgb common_noise) {
    struct measurement m = {.weight = robust_weigh(observations->observation, observations->count, TRUST, scale)};
    rgb value = {0.0f, 0.0f, 0.0f}, noise = value;
    float mixing = 0.0f;
    for (size_t i = 0; i < observations->count; i++) {
        const struct robust_sample *l = &observations->observation[i];
        float share = l->weight / m.weight;
        value = rgb_mad(value, share, l->value);
        noise = rgb_mad(noise, share, l->noise);
        mixing += share * l->mixing;
    }
    split_half_draw(observations->observation, observations->count, &noise);
    rgb_to_half(m.value, value);
    rgb_to_half(m.noise, rgb_add(noise, rgb_mul(value, common_noise)));
    m.mixing = image_half_from_float(mixing);
    return m;
}
