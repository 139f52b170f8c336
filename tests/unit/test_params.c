/* params.h: how texels, blocks and segments move. */
#include "server/refine/params.h"

#include "tests/check.h"
#include "tests/unit/surface.h"

/* Steps against a gradient: texels by themselves at level 0, a block together above; segments only
 * once the emitters are known, and then exactly 0 for all others. */
static void test_step(void) {
    struct materials m;
    struct params p;
    struct emission e;
    struct parallel *pool = parallel_new(1);
    uint32_t texel[2] = {0, 1};
    rgb d_base[2] = {{1, -1, 0}, {1, -1, 0}};
    double d_roughness[2] = {1, 0}, d_specular[2] = {0, -1}, d_emission[2][3] = {{0}, {-1, -1, -1}};
    struct gradient g = {.texel_count = 2,
                         .texel = texel,
                         .d_base_color = d_base,
                         .segment_count = 2,
                         .d_roughness = d_roughness,
                         .d_specular = d_specular,
                         .d_emission = d_emission};
    struct params_rates rates = {.base_color = 0.1f, .roughness = 0.1f, .specular = 0.1f, .emission = 0.1f};
    materials_init(&m, &inverse, 2, rgb_gray(0.5f), 0.5f, 0.5f);
    m.emission[0] = m.emission[1] = rgb_gray(2.0f);
    emission_init(&e, &m);
    params_init(&p, &m, &inverse, &segments, &e, 1);
    params_step(&p, &g, &rates, pool);
    CHECK_NEAR(m.base_color.texel[0][0], 0.5 * exp(-0.2), 1e-5);
    CHECK_NEAR(m.base_color.texel[SIDE][1], 0.5 * exp(0.2), 1e-5); /* same block, not touched itself */
    CHECK(m.base_color.texel[2][0] == 0.5f);
    CHECK(m.roughness[0] == 0.5f && m.emission[1].r == 2.0f);

    const bool is_emitter[2] = {false, true};
    emission_fix(&e, is_emitter);
    params_free_segments(&p);
    params_refine(&p, 0);
    float before = m.base_color.texel[0][0];
    params_step(&p, &g, &rates, pool);
    CHECK_NEAR(m.base_color.texel[0][0], before - 0.1f, 1e-5);
    CHECK_NEAR(m.roughness[0], 0.4, 1e-5);
    CHECK_NEAR(m.specular[1], 0.6, 1e-5);
    CHECK(rgb_is_black(m.emission[0]));
    CHECK_NEAR(m.emission[1].g, 2.0 * exp(0.1), 1e-4);
    for (int i = 0; i < 100; i++)
        params_step(&p, &g, &rates, pool);
    CHECK(m.base_color.texel[0][0] == 0.0f && m.base_color.texel[0][1] == 1.0f);
    CHECK_NEAR(m.roughness[0], PARAMS_ROUGHNESS_MIN, 1e-6);
    CHECK(rgb_is_black(m.emission[0]));
    params_release(&p);
    emission_release(&e);
    materials_release(&m);
    parallel_free(pool);
}

int main(void) {
    make_surface();
    test_step();
    return check_result();
}
