/* match.h: what a look tells as a ratio, and the window that moves by it. */
#include "server/reconstruct/match.h"

#include <math.h>

#include "common/rng.h"
#include "tests/check.h"
#include "tests/unit/surface.h"

static const uint32_t chart_of_triangle[2] = {0, 1};

/* A surface of base colour .5, and what moves it in windows of 4 texels. */
struct grey {
    struct materials materials;
    struct emission emission;
    struct matcher matcher;
};

static void grey_init(struct grey *g) {
    materials_init(&g->materials, &inverse, 2, rgb_gray(0.5f), 0.5f, 0.5f);
    emission_init(&g->emission, &g->materials);
    matcher_init(&g->matcher, &g->materials.base_color, &inverse, &segments, chart_of_triangle, &g->emission, 2);
}

static void grey_release(struct grey *g) {
    matcher_release(&g->matcher);
    emission_release(&g->emission);
    materials_release(&g->materials);
}

/* Looks at texel 0 whose light is noisy around 0.8: the block's base colour finds shown / light,
 * keeps its detail, and nothing moves that is further away than half a block. */
static void test_step(void) {
    struct grey g;
    grey_init(&g);
    g.materials.base_color.texel[1][0] = 0.25f; /* detail: half as red as its neighbours */
    for (int look = 0; look < 3000; look++) {
        float *red = &g.materials.base_color.texel[0][0];
        struct match match;
        for (int c = 0; c < 3; c++) {
            float light = 0.8f * (0.5f + rng_to_float((uint32_t)rng_key(1, (uint64_t)look, (uint64_t)c)));
            match.shown[c] = 1.0f; /* relative to a radiance of 0.432 */
            match.rendered[c] = red[c] * light / 0.432f;
        }
        matcher_step(&g.matcher, 0, &match, 1.0f);
    }
    for (int c = 0; c < 3; c++)
        CHECK_NEAR(g.materials.base_color.texel[0][c], 0.54, 0.02);
    CHECK_NEAR(g.materials.base_color.texel[1][0] / g.materials.base_color.texel[0][0], 0.5, 1e-4);
    CHECK_NEAR(g.materials.base_color.texel[2 * SIDE + 2][1], g.materials.base_color.texel[0][1], 1e-6);
    CHECK(g.materials.base_color.texel[3][0] == 0.5f && g.materials.base_color.texel[3 * SIDE][0] == 0.5f);
    grey_release(&g);
}

/* However long looks ask for more, they move base colour by a tenth. */
static void test_bound(void) {
    const struct match match = {.shown = {3, 1, 0.2f}, .rendered = {1, 1, 1}, .trust = 1.0f};
    struct grey g;
    grey_init(&g);
    for (int look = 0; look < 1000; look++)
        matcher_step(&g.matcher, 0, &match, 1.0f);
    CHECK_NEAR(g.materials.base_color.texel[0][0], 0.5 * exp(0.1), 1e-4);
    CHECK_NEAR(g.materials.base_color.texel[0][1], 0.5, 1e-4);
    CHECK_NEAR(g.materials.base_color.texel[0][2], 0.5 * exp(-0.1), 1e-4);
    grey_release(&g);
}

/* A window ends where the chart does, and an emitter's moves a twentieth as far. */
static void test_window(void) {
    const bool is_emitter[2] = {false, true};
    const struct match twice = {.shown = {2, 2, 2}, .rendered = {1, 1, 1}, .trust = 1.0f};
    struct grey g;
    grey_init(&g);
    emission_fix(&g.emission, is_emitter);
    matcher_step(&g.matcher, SIDE / 2 - 1, &twice, 1.0f);
    float wall = g.materials.base_color.texel[SIDE / 2 - 1][0] / 0.5f - 1.0f;
    CHECK(wall > 0.0f && g.materials.base_color.texel[SIDE / 2][0] == 0.5f);
    matcher_step(&g.matcher, SIDE / 2, &twice, 1.0f);
    CHECK_NEAR(g.materials.base_color.texel[SIDE / 2][0] / 0.5f - 1.0f, 0.05f * wall, 1e-5);
    grey_release(&g);
}

/* A saturated channel counts as equal where the render exceeds the clip, and as the clip where not;
 * what is as far off as all that is expected is trusted by half. */
static void test_look(void) {
    const struct photograph_sample shown = {.radiance = {1, 1, 2}, .saturated = {true, true, false},
                                            .clip_radiance = {1, 1, 1}};
    const rgb rendered = {3, 0.5f, 1};
    struct match match = match_look(&shown, &rendered, 1, rgb_gray(1.0f), 0.0f, 0.0f);
    CHECK(match.shown[0] == 3.0f && match.rendered[0] == 3.0f);
    CHECK(match.shown[1] == 1.0f && match.rendered[1] == 0.5f);
    CHECK(match.shown[2] == 2.0f && match.rendered[2] == 1.0f);
    CHECK_NEAR(match.trust, 0.5, 1e-6);
}

/* Renders that are right and photographs whose noise is as large as what they show, seldom far too bright and often too
 * dark: no look is an outlier, and base colour stays within 4 %. */
static void test_noise(void) {
    struct grey g;
    grey_init(&g);
    for (uint64_t look = 0; look < 20000; look++) {
        float bright = -logf(1.0f - rng_to_float((uint32_t)rng_key(2, look, 0))); /* 1 in the mean, and its deviation */
        const struct photograph_sample shown = {.radiance = rgb_gray(bright)};
        const rgb rendered = rgb_scale(rgb_gray(2.0f), g.materials.base_color.texel[0][0]);
        struct match match = match_look(&shown, &rendered, 1, rgb_gray(1.0f), 1.0f, 1.0f);
        matcher_step(&g.matcher, 0, &match, match.trust);
    }
    CHECK_NEAR(g.materials.base_color.texel[0][0] / 0.5f, 1.0, 0.04);
    grey_release(&g);
}

int main(void) {
    make_surface();
    test_step();
    test_bound();
    test_window();
    test_look();
    test_noise();
    return check_result();
}
