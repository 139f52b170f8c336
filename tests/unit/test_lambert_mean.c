/* lambert_mean.h: a white sill, half of it deep in the shade, is no lamp: its light end is compared with the light
 * there. */
#include "server/light/decision/lambert_mean.h"

#include "tests/check.h"

#define WHITE 0.8f
#define SHADE 0.05f

int main(void) {
    struct emitter_evidence evidence = {.is_seen = true};
    struct lambert_mean sill = {0}, dim = {0};
    rgb mean;
    CHECK(!lambert_mean_of(&sill, &mean));
    evidence_set_radiance(&evidence, rgb_gray(WHITE));
    for (int i = 0; i < 100; i++) {
        float light = i % 2 ? 1.0f : SHADE;
        lambert_mean_add(&sill, &evidence, rgb_gray(WHITE * light), rgb_gray(light));
        lambert_mean_add(&dim, &evidence, rgb_gray(WHITE * SHADE), rgb_gray(SHADE));
    }
    CHECK(lambert_mean_of(&sill, &mean));
    CHECK_NEAR(mean.g, 1.0, 1e-5);
    evidence_set_lambert(&evidence, mean);
    CHECK_THAT(evidence.emitted_share <= 0.0f, "%g", (double)evidence.emitted_share);
    CHECK(lambert_mean_of(&dim, &mean)); /* nothing is as bright as the segment: all of it */
    CHECK_NEAR(mean.g, SHADE, 1e-5);
    return check_result();
}
