/* light_fit.h: a point that is too dark in all its photographs says nothing, however often it is weighed; a tone
 * curve does not choose which points speak. */
#include "server/capture/light_fit.h"

#include <math.h>

#include "tests/check.h"

#define COUNT 3

int main(void) {
    struct photograph photo[COUNT];
    uint32_t train[COUNT];
    struct overlap_observation observation[COUNT];
    size_t start[] = {0, COUNT};
    for (uint32_t i = 0; i < COUNT; i++) {
        photo[i] = (struct photograph){.exposure_known = true, .exposure = 1.0f};
        photo[i].camera.width = photo[i].camera.height = 2;
        train[i] = i;
        observation[i] = (struct overlap_observation){.train = i, .cosine = 1.0f};
        for (int c = 0; c < 3; c++) {
            observation[i].value[c] = observation[i].level[c] = -0.25f - 0.01f * (float)i;
            observation[i].min_value[c] = -0.04f;
            observation[i].max_value[c] = 3.6f;
        }
    }
    struct scene scene = {.photograph = photo, .photograph_count = COUNT};
    struct views views = {.scene = &scene, .train = train, .train_count = COUNT};
    struct overlaps overlaps = {1, start, observation};
    struct light_fit fit;
    double x[3 * COUNT + 3 + TONE_TERMS] = {0.0}, weight[COUNT], square[COUNT];
    light_fit_init(&fit, &views, &overlaps);
    for (int is_dark = 1; is_dark >= 0; is_dark--) {
        for (int i = 0; i < COUNT; i++) {
            weight[i] = fit.prior_weight[i];
            for (int c = 0; c < 3 && !is_dark; c++)
                observation[i].min_value[c] = -3.0f;
        }
        for (int round = 0; round < 6; round++) {
            light_fit_residuals(&fit, 0, x, 0, weight, square);
            for (int i = 0; i < COUNT; i++) {
                CHECK_THAT(is_dark ? isinf(square[i]) : square[i] < 1.0, "round %d: %g", round, square[i]);
                weight[i] = fit.prior_weight[i] / (1.0 + square[i]);
            }
        }
    }
    observation[0].min_value[0] = 10.0f;
    light_fit_residuals(&fit, LIGHT_TONES, x, 0, fit.prior_weight, square);
    CHECK(isfinite(square[0]));
    light_fit_residuals(&fit, 0, x, 0, fit.prior_weight, square);
    CHECK(isinf(square[0]));
    light_fit_release(&fit);
    return check_result();
}
