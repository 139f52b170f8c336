/* emission.h: radiance moves in the logarithm, what is black stays black, others may be put out for good. */
#include "server/refine/emission.h"

#include "tests/check.h"
#include "tests/unit/surface.h"

int main(void) {
    const double brighter[2][3] = {{-1, -1, -1}, {-1, 2, 0}};
    const bool is_emitter[2] = {false, true};
    struct materials m;
    struct emission e;
    make_surface();
    materials_init(&m, &inverse, segments.count, rgb_gray(0.5f), 0.5f, 0.5f);
    m.emission[1] = (rgb){2, 1000, 4};
    emission_init(&e, &m);
    emission_step(&e, brighter, 0.1f);
    CHECK(rgb_is_black(m.emission[0]));
    /* A first step of Adam is of the rate's size, whatever the derivative's, so a factor. */
    CHECK_NEAR(m.emission[1].r, 2.0 * exp(0.1), 1e-4);
    CHECK_NEAR(m.emission[1].g, 1000.0 * exp(-0.1), 0.1);
    CHECK_NEAR(m.emission[1].b, 4.0, 1e-4);
    emission_set(&e, 0, rgb_gray(3.0f));
    CHECK(emission_slowdown(&e, 0) == 1.0f && emission_slowdown(&e, 1) == 1.0f);
    emission_fix(&e, is_emitter);
    CHECK(emission_slowdown(&e, 0) == 1.0f && emission_slowdown(&e, 1) < 0.5f);
    for (int i = 0; i < 2000; i++)
        emission_step(&e, brighter, 1.0f);
    CHECK(rgb_is_black(m.emission[0]));
    CHECK(isfinite(m.emission[1].r) && m.emission[1].g > 0.0f);
    emission_release(&e);
    materials_release(&m);
    return check_result();
}
