/* params.h: how texels, blocks and segments move. */
#include "server/reconstruct/params.h"

#include "common/rng.h"
#include "tests/check.h"

#define SIDE 8
#define TEXELS (SIDE * SIDE)

/* Two triangles, one of each segment: the left half of the texture and the right one. The last
 * column is not valid. */
static uint32_t triangle[TEXELS], valid[TEXELS], of_triangle[2] = {0, 1};
static struct inverse_uv inverse = {.width = SIDE, .height = SIDE, .triangle = triangle, .valid = valid};
static struct segments segments = {.count = 2, .of_triangle = of_triangle};

static void make_surface(void) {
    inverse.valid_count = 0;
    for (uint32_t i = 0; i < TEXELS; i++) {
        uint32_t x = i % SIDE;
        triangle[i] = x == SIDE - 1 ? INVERSE_UV_NONE : x < SIDE / 2 ? 0 : 1;
        if (triangle[i] != INVERSE_UV_NONE)
            valid[inverse.valid_count++] = i;
    }
}

/* Looks at texel 0 whose light is noisy around 0.8: the block's base colour finds shown / light,
 * keeps its detail, and nothing moves that is further away than half a block. */
static const uint32_t chart_of_triangle[2] = {0, 1};

static void test_match(void) {
    struct materials m;
    struct params p;
    materials_init(&m, &inverse, 2, rgb_gray(0.5f), 0.5f, 0.5f);
    m.base_color.texel[1][0] = 0.25f; /* detail: half as red as its neighbours */
    params_init(&p, &m, &inverse, &segments, chart_of_triangle, 2);
    for (int look = 0; look < 3000; look++) {
        float *red = &m.base_color.texel[0][0];
        struct loss_match match;
        for (int c = 0; c < 3; c++) {
            float light = 0.8f * (0.5f + rng_to_float((uint32_t)rng_key(1, (uint64_t)look, (uint64_t)c)));
            match.shown[c] = 1.0f; /* relative to a radiance of 0.48 */
            match.rendered[c] = red[c] * light / 0.48f;
        }
        params_match(&p, 0, &match, 1.0f);
    }
    for (int c = 0; c < 3; c++)
        CHECK_NEAR(m.base_color.texel[0][c], 0.6, 0.02);
    CHECK_NEAR(m.base_color.texel[1][0] / m.base_color.texel[0][0], 0.5, 1e-4);
    CHECK_NEAR(m.base_color.texel[2 * SIDE + 2][1], m.base_color.texel[0][1], 1e-6);
    CHECK(m.base_color.texel[3][0] == 0.5f && m.base_color.texel[3 * SIDE][0] == 0.5f);
    params_release(&p);
    materials_release(&m);
}

/* Steps against a gradient: texels by themselves at level 0, a block together above; segments only
 * once the emitters are known, and then exactly 0 for all others. */
static void test_step(void) {
    struct materials m;
    struct params p;
    struct parallel *pool = parallel_new(1);
    uint32_t texel[2] = {0, 1};
    rgb d_base[2] = {{1, -1, 0}, {1, -1, 0}};
    double d_roughness[2] = {1, 0}, d_specular[2] = {0, -1}, d_emission[2][3] = {{0}, {-1, -1, -1}};
    struct gradient g = {.texel_count = 2, .texel = texel, .d_base_color = d_base, .segment_count = 2,
                         .d_roughness = d_roughness, .d_specular = d_specular, .d_emission = d_emission};
    struct params_rates rates = {.base_color = 0.1f, .roughness = 0.1f, .specular = 0.1f, .emission = 0.1f};
    materials_init(&m, &inverse, 2, rgb_gray(0.5f), 0.5f, 0.5f);
    m.emission[0] = m.emission[1] = rgb_gray(2.0f);
    params_init(&p, &m, &inverse, &segments, chart_of_triangle, 1);
    params_step(&p, &g, &rates, pool);
    CHECK_NEAR(m.base_color.texel[0][0], 0.5 * exp(-0.2), 1e-5);
    CHECK_NEAR(m.base_color.texel[SIDE][1], 0.5 * exp(0.2), 1e-5); /* same block, not touched itself */
    CHECK(m.base_color.texel[2][0] == 0.5f);
    CHECK(m.roughness[0] == 0.5f && m.emission[1].r == 2.0f);

    const bool is_emitter[2] = {false, true};
    params_fix_emitters(&p, is_emitter);
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
    materials_release(&m);
    parallel_free(pool);
}

int main(void) {
    make_surface();
    test_match();
    test_step();
    return check_result();
}
