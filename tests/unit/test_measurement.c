/* measurement.h: a look of much weight counts for much where the others do not contradict it; into a highlight that
 * none of the others shows it does not, however sharp it is; the error that all share is in the noise. */
#include "server/material/measurement.h"

#include <math.h>

#include "tests/check.h"

#define OBSERVATIONS 10
#define SCALE 0.3f

/* LOOKS - 1 of the value `dark`, more or less, and one of so much more weight of the value `other`. */
static float mean_with(float dark, float other, float weight) {
    struct measurement_observations observations = {.count = OBSERVATIONS};
    for (int i = 0; i < OBSERVATIONS; i++) {
        float value = i == 0 ? other : dark * (1.0f + 0.02f * (float)(i - OBSERVATIONS / 2));
        observations.observation[i] = (struct robust_sample){.value = rgb_gray(value),
                                                             .gray = logf(value),
                                                             .deviation = 0.05f,
                                                             .weight = i == 0 ? weight : 1.0f,
                                                             .source = (uint32_t)i};
    }
    struct measurement m = measurement_mean(&observations, SCALE, rgb_gray(0.0f));
    return rgb_mean(measurement_value(&m));
}

/* What all observations share of the light's error is noise of their mean, and nothing else is where they agree. */
static void test_common_noise(void) {
    struct measurement_observations observations = {.count = OBSERVATIONS};
    const rgb value = {0.5f, 0.25f, 0.125f}, common = {0.1f, -0.2f, 0.3f};
    for (int i = 0; i < OBSERVATIONS; i++)
        observations.observation[i] = (struct robust_sample){
            .value = value, .gray = 0.0f, .deviation = 0.05f, .weight = 1.0f, .source = (uint32_t)i, .sharp = 1.0f};
    struct measurement m = measurement_mean(&observations, SCALE, common);
    rgb noise = rgb_from_half(m.noise);
    CHECK_NEAR(noise.r, value.r * common.r, 1e-4f);
    CHECK_NEAR(noise.g, value.g * common.g, 1e-4f);
    CHECK_NEAR(noise.b, value.b * common.b, 1e-4f);
}

int main(void) {
    test_common_noise();
    CHECK_NEAR(mean_with(0.1f, 0.1f, 1.0f), 0.1f, 0.002f);
    CHECK_NEAR(mean_with(0.1f, 0.12f, 50.0f), 0.117f, 0.003f);
    CHECK_NEAR(mean_with(0.1f, 2.0f, 50.0f), 0.1f, 0.15f); /* as the one that saw most: 2 */
    return check_result();
}
