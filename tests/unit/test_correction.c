/* correction.h: factors of base colour from noisy observations, and their priors where there are few. */
#include "server/refine/correction.h"

#include <math.h>

#include "common/mem.h"
#include "common/rng.h"
#include "server/scene/rgb_half.h"
#include "tests/check.h"

#define WIDTH 64
#define HEIGHT 32
#define TEXELS (WIDTH * HEIGHT)
#define SPACING 8

/* Two charts: the left half and the right one. */
static uint32_t triangle[TEXELS], valid[TEXELS], chart_of_triangle[2] = {0, 1};
static struct inverse_uv inverse = {.width = WIDTH, .height = HEIGHT, .triangle = triangle, .valid = valid};
static struct texture base_color;
static struct correction correction;
static struct parallel *pool;

static void make_surface(void) {
    for (uint32_t i = 0; i < TEXELS; i++) {
        triangle[i] = i % WIDTH < WIDTH / 2 ? 0 : 1;
        valid[inverse.valid_count++] = i;
    }
}

/* A surface of base colour .5, but for one texel. */
static void begin(void) {
    texture_init(&base_color, &inverse, rgb_gray(0.5f));
    base_color.texel[1][0] = 0.25f;
    correction_init(&correction, &base_color, &inverse, chart_of_triangle, SPACING);
    correction_start(&correction);
}

static void end(void) {
    correction_release(&correction);
    texture_release(&base_color);
}

/* How far each channel of the photographs tells. */
static float channel_weight[3] = {1.0f, 1.0f, 1.0f};

/* Observes the texels of columns [x0, x1): shown is `ratio` times what base colour as solved would have rendered, by
 * channel, both with noise of half of it and more; base colour moves in between. */
static void observe(uint32_t x0, uint32_t x1, const float ratio[3], uint64_t rounds) {
    for (uint64_t round = 0; round < rounds; round++) {
        for (uint32_t i = 0; i < TEXELS; i++) {
            if (i % WIDTH < x0 || i % WIDTH >= x1)
                continue;
            struct comparison comparison;
            for (int c = 0; c < 3; c++) {
                float noise = 2.0f * rng_to_float((uint32_t)rng_key(1, round * TEXELS + i, (uint64_t)c));
                float bright = -logf(1.0f - rng_to_float((uint32_t)rng_key(2, round * TEXELS + i, (uint64_t)c)));
                comparison.observed[c] = ratio[c] * bright;
                comparison.channel_weight[c] = channel_weight[c];
                comparison.rendered[c] = noise * base_color.texel[i][c] / (i == 1 && c == 0 ? 0.25f : 0.5f);
            }
            correction_add(&correction, i, &comparison, 1.0f);
        }
        if (round % 16 == 15)
            correction_apply(&correction, pool);
    }
    correction_apply(&correction, pool);
}

static double factor(uint32_t x, uint32_t y, int channel) {
    return (double)base_color.texel[y * WIDTH + x][channel] / 0.5;
}

/* Many observations determine the factor; texture stays. */
static void test_many(void) {
    const float ratio[3] = {1.05f, 1.05f, 1.05f};
    begin();
    observe(0, WIDTH, ratio, 256);
    for (int c = 0; c < 3; c++)
        CHECK_NEAR(factor(20, 16, c), 1.05, 0.012);
    CHECK_NEAR(factor(1, 0, 0), 0.5 * factor(1, 0, 1), 0.005);
    end();
}

/* A cell without observations follows its neighbours, but not with another chart's; where nothing is near it goes
 * back to what was solved. */
static void test_beside(void) {
    const float ratio[3] = {1.08f, 1.08f, 1.08f};
    begin();
    observe(0, 8, ratio, 256);
    double here = factor(4, 16, 0), beside = factor(12, 16, 0), far = factor(28, 16, 0);
    CHECK_THAT(here > 1.05 && beside > 1.02 && beside < here && far < beside, "%.3f %.3f %.3f", here, beside, far);
    CHECK_NEAR(factor(40, 16, 0), 1.0, 1e-3);
    end();
}

/* Few observations change little, and tint less than lightness. */
static void test_few(void) {
    const float lighter[3] = {1.08f, 1.08f, 1.08f}, redder[3] = {1.08f, 1.0f, 1.0f};
    begin();
    observe(0, WIDTH, lighter, 1);
    double light = factor(20, 16, 0) - 1.0;
    end();
    begin();
    observe(0, WIDTH, redder, 64);
    double red = factor(20, 16, 0) - factor(20, 16, 1);
    end();
    CHECK_THAT(fabs(light) < 0.06, "%.4f", light);
    CHECK_THAT(red > 0.005 && red < 0.075, "%.4f", red);
}

/* A channel in which photographs show their noise and little else says nothing of the lightness of the others. */
static void test_lost_channel(void) {
    const float ratio[3] = {1.0f, 1.0f, 1.5f};
    begin();
    channel_weight[2] = 0.01f;
    observe(0, WIDTH, ratio, 128);
    channel_weight[2] = 1.0f;
    CHECK_THAT(fabs(factor(20, 16, 0) - 1.0) < 0.01 && factor(20, 16, 2) < 1.06, "%.4f %.4f", factor(20, 16, 0),
               factor(20, 16, 2)); /* each alike: 1.06 */
    end();
}

/* Looks that tell little of each cell tell much of what a chart's cells share. */
static void test_together(void) {
    const float ratio[3] = {1.08f, 1.08f, 1.08f};
    double mean = 0.0;
    begin();
    observe(0, WIDTH, ratio, 8);
    for (uint32_t i = 2; i < TEXELS; i++)
        mean += factor(i % WIDTH, i / WIDTH, 1) / (TEXELS - 2);
    CHECK_NEAR(mean, 1.08, 0.015);
    end();
}

/* Renders that are right and photographs that are seldom far too bright and often too dark: base colour stays. */
static void test_noise(void) {
    const float ratio[3] = {1.0f, 1.0f, 1.0f};
    double squares = 0.0;
    begin();
    observe(0, WIDTH, ratio, 16);
    for (uint32_t i = 0; i < TEXELS; i++)
        squares += i == 1 ? 0.0 : pow(factor(i % WIDTH, i / WIDTH, 0) - 1.0, 2.0);
    CHECK_THAT(sqrt(squares / TEXELS) < 0.01, "%.4f", sqrt(squares / TEXELS)); /* cells alone: .04 */
    end();
}

/* To apply what was applied changes nothing. */
static void test_again(void) {
    const float ratio[3] = {1.05f, 1.0f, 0.97f};
    begin();
    observe(0, WIDTH / 4, ratio, 8);
    double once = factor(20, 16, 0);
    correction_apply(&correction, pool);
    CHECK(factor(20, 16, 0) == once && once != 1.0);
    end();
}

/* What a texel is expected to show has its texture, and not the noise of what photographs show of it alone; of a cell
 * of which they show nothing, nothing is expected. */
static void test_expected(void) {
    uint16_t radiance[TEXELS][3];
    float count[TEXELS];
    const struct fused fused = {.width = WIDTH, .height = HEIGHT, .radiance = radiance, .count = count};
    begin();
    for (uint32_t i = 0; i < TEXELS; i++) {
        float shown = (i + i / WIDTH) % 2 ? 1.5f : 0.5f; /* 1 in the mean */
        bool is_shown = i % WIDTH < WIDTH / 2;
        rgb_to_half(radiance[i], i == 1 ? rgb_make(0.75f, 1.5f, 1.5f) : rgb_gray(is_shown ? shown : 0.0f));
        count[i] = i / WIDTH < 24 && is_shown ? 1.0f : 0.0f; /* below that only beside other surfaces */
    }
    correction_set_light(&correction, &fused);
    rgb plain = correction_expected(&correction, 20 * WIDTH + 20), texture = correction_expected(&correction, 1);
    CHECK_NEAR(plain.g, 1.0, 1e-3);
    CHECK_NEAR(correction_expected(&correction, 28 * WIDTH + 4).g, 1.0, 1e-3);
    CHECK_NEAR(texture.g, 1.0, 1e-3);
    CHECK_NEAR(texture.r, 0.5, 0.01);
    CHECK(rgb_is_black(correction_expected(&correction, WIDTH - 1)));
    end();
}

/* No number of observations changes base colour by more than a tenth. */
static void test_bound(void) {
    const float ratio[3] = {3.0f, 1.0f, 0.2f};
    begin();
    observe(0, WIDTH, ratio, 512);
    CHECK_NEAR(factor(20, 16, 0), exp(0.1), 1e-3);
    CHECK_NEAR(factor(20, 16, 2), exp(-0.1), 1e-3);
    end();
}

static void test_threads(void) {
    const float ratio[3] = {1.05f, 1.0f, 0.97f};
    begin();
    observe(0, WIDTH, ratio, 8);
    struct texture one = base_color;
    correction_release(&correction);
    struct parallel *alone = pool;
    pool = parallel_new(3);
    begin();
    observe(0, WIDTH, ratio, 8);
    CHECK(memcmp(one.texel, base_color.texel, TEXELS * sizeof *one.texel) == 0);
    end();
    parallel_free(pool);
    pool = alone;
    texture_release(&one);
}

int main(void) {
    make_surface();
    pool = parallel_new(1);
    test_many();
    test_beside();
    test_few();
    test_together();
    test_lost_channel();
    test_noise();
    test_bound();
    test_again();
    test_expected();
    test_threads();
    parallel_free(pool);
    return check_result();
}
