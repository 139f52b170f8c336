/* comparison.h: observed and rendered radiance of an observation. */
#include "server/refine/comparison.h"

#include "tests/check.h"

/* A saturated channel counts as equal where the render exceeds the clip, and as the clip where not;
 * a photograph that differs by the expected radiance has half its weight. */
static void test_observation(void) {
    const struct photograph_sample observed = {
        .radiance = {1, 1, 2}, .saturated = {true, true, false}, .clip_radiance = {1, 1, 1}};
    const rgb rendered = {3, 0.5f, 1};
    struct comparison comparison = comparison_make(&observed, &rendered, 1, rgb_gray(1.0f), rgb_gray(0.0f), 0.0f);
    CHECK(comparison.observed[0] == 3.0f && comparison.rendered[0] == 3.0f);
    CHECK(comparison.observed[1] == 1.0f && comparison.rendered[1] == 0.5f);
    CHECK(comparison.observed[2] == 2.0f && comparison.rendered[2] == 1.0f);
    CHECK_NEAR(comparison.weight, 0.5, 1e-6);
    for (int c = 0; c < 3; c++)
        CHECK(comparison.channel_weight[c] == 1.0f);
}

/* A channel in which the photograph is noise tells little; what is read as less than black is taken as it is. */
static void test_noise(void) {
    const struct photograph_sample observed = {.radiance = {1, 0.1f, -0.01f}};
    const rgb rendered = {1, 0.1f, 0.01f};
    struct comparison comparison =
        comparison_make(&observed, &rendered, 1, (rgb){1, 0.1f, 0.01f}, rgb_gray(0.04f), 0.0f);
    CHECK(comparison.channel_weight[0] > 0.98f && comparison.channel_weight[2] < 0.01f);
    CHECK_NEAR(comparison.channel_weight[1], 0.1 / (0.1 + 0.16), 1e-5);
    CHECK_NEAR(comparison.observed[2], -1.0, 1e-5);
}

int main(void) {
    test_observation();
    test_noise();
    return check_result();
}
