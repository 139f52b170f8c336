/* match.h: what a look tells. */
#include "server/refine/match.h"

#include "tests/check.h"

/* A saturated channel counts as equal where the render exceeds the clip, and as the clip where not;
 * what is as far off as all that is expected is trusted by half. */
static void test_look(void) {
    const struct photograph_sample shown = {.radiance = {1, 1, 2}, .saturated = {true, true, false},
                                            .clip_radiance = {1, 1, 1}};
    const rgb rendered = {3, 0.5f, 1};
    struct match match = match_look(&shown, &rendered, 1, rgb_gray(1.0f), rgb_gray(0.0f), 0.0f);
    CHECK(match.shown[0] == 3.0f && match.rendered[0] == 3.0f);
    CHECK(match.shown[1] == 1.0f && match.rendered[1] == 0.5f);
    CHECK(match.shown[2] == 2.0f && match.rendered[2] == 1.0f);
    CHECK_NEAR(match.trust, 0.5, 1e-6);
    for (int c = 0; c < 3; c++)
        CHECK(match.worth[c] == 1.0f);
}

/* A channel in which the photograph is noise tells little; what is read as less than black is taken as it is. */
static void test_noise(void) {
    const struct photograph_sample shown = {.radiance = {1, 0.1f, -0.01f}};
    const rgb rendered = {1, 0.1f, 0.01f};
    struct match match = match_look(&shown, &rendered, 1, (rgb){1, 0.1f, 0.01f}, rgb_gray(0.04f), 0.0f);
    CHECK(match.worth[0] > 0.98f && match.worth[2] < 0.01f);
    CHECK_NEAR(match.worth[1], 0.1 / (0.1 + 0.16), 1e-5);
    CHECK_NEAR(match.shown[2], -1.0, 1e-5);
}

int main(void) {
    test_look();
    test_noise();
    return check_result();
}
