/* denoise.h: noise goes, texture stays, holes are filled, and nothing crosses from chart to chart. */
#include "server/material/denoise.h"

#include "common/mem.h"
#include "tests/check.h"
#include "tests/unit/normal.h"

#define WIDTH 256
#define HEIGHT 128
#define TEXELS (WIDTH * HEIGHT)
#define DEVIATION 0.1f /* of the noise, of each channel */

/* Two charts: the left half and the right one, with two columns between them that no triangle covers. */
static uint32_t triangle[TEXELS], valid[TEXELS], chart_of_triangle[2] = {0, 1};
static vec2 corner[2][3] = {{{0, 0}, {WIDTH / 2 - 1, 0}, {0, HEIGHT}},
                            {{WIDTH / 2 + 1, 0}, {WIDTH, 0}, {WIDTH, HEIGHT}}};
static const struct atlas atlas = {
    .width = WIDTH, .height = HEIGHT, .chart_count = 2, .chart_of_triangle = chart_of_triangle, .corner = corner};
static struct inverse_uv inverse = {.width = WIDTH, .height = HEIGHT, .triangle = triangle, .valid = valid};

static struct measurement *measured;
static struct color_prior prior[2];
static struct texture out;
static uint16_t deviation[TEXELS];
static struct parallel *pool;

static void make_surface(void) {
    for (uint32_t i = 0; i < TEXELS; i++) {
        uint32_t x = i % WIDTH;
        triangle[i] = x < WIDTH / 2 - 1 ? 0 : x > WIDTH / 2 ? 1 : INVERSE_UV_NONE;
        if (triangle[i] != INVERSE_UV_NONE)
            valid[inverse.valid_count++] = i;
    }
}

/* What is there: the left chart is plain, the right one has stripes. */
static float truth(uint32_t x, uint32_t y) {
    (void)y;
    return x < WIDTH / 2 ? 0.8f : x / 4 % 2 ? 0.7f : 0.2f;
}

static void set(uint32_t x, uint32_t y, float value, float noise, float mixing) {
    struct measurement *m = &measured[y * WIDTH + x];
    *m = (struct measurement){.weight = 1.0f, .mixing = image_half_from_float(mixing)};
    for (int c = 0; c < 3; c++) {
        m->value[c] = image_half_from_float(value);
        m->noise[c] = image_half_from_float(noise);
    }
}

/* Gray noise: the same of all channels; its draws are independent of it. */
static void measure(void) {
    for (uint32_t y = 0; y < HEIGHT; y++)
        for (uint32_t x = 0; x < WIDTH; x++)
            set(x, y, truth(x, y) + DEVIATION * normal(1, y * WIDTH + x), DEVIATION * normal(2, y * WIDTH + x), 0.0f);
}

static void filter(void) {
    prior[0] = prior[1] = (struct color_prior){rgb_gray(0.5f), 0.05f};
    texture_init(&out, &inverse, rgb_gray(0.0f));
    denoise(&atlas, &inverse, 2, measured, prior, NULL, &out, 1, deviation, pool);
}

/* Root mean square error over [x0, x1) x [y0, y1). */
static double error_of(uint32_t x0, uint32_t x1, uint32_t y0, uint32_t y1) {
    double sum = 0.0;
    for (uint32_t y = y0; y < y1; y++)
        for (uint32_t x = x0; x < x1; x++) {
            double off = (double)(out.texel[y * WIDTH + x][1] - truth(x, y));
            sum += off * off;
        }
    return sqrt(sum / ((x1 - x0) * (y1 - y0)));
}

/* Root mean square of the stated deviations over [x0, x1). */
static double stated_over(uint32_t x0, uint32_t x1) {
    double sum = 0.0;
    for (uint32_t y = 0; y < HEIGHT; y++)
        for (uint32_t x = x0; x < x1; x++) {
            double d = (double)image_float_from_half(deviation[y * WIDTH + x]);
            sum += d * d;
        }
    return sqrt(sum / ((x1 - x0) * HEIGHT));
}

/* The stated deviation is that of the error: its mean square over [x0, x1), and how many errors are within it.
 * Above it, since here edges fall between texels, where no measurement is off: most of what is stated of stripes is
 * that. */
static void check_deviation(uint32_t x0, uint32_t x1) {
    double stated = stated_over(x0, x1), real = error_of(x0, x1, 0, HEIGHT);
    size_t within = 0, count = 0;
    for (uint32_t y = 0; y < HEIGHT; y++)
        for (uint32_t x = x0; x < x1; x++, count++) {
            double d = (double)image_float_from_half(deviation[y * WIDTH + x]);
            within += fabs((double)(out.texel[y * WIDTH + x][1] - truth(x, y))) <= d;
        }
    double share = (double)within / (double)count;
    CHECK_THAT(stated > 0.7 * real && stated < 3.5 * real, "%.4f is stated, the error is %.4f", stated, real);
    CHECK_THAT(share > 0.55 && share < 0.97, "%.2f of the errors are within one deviation", share);
}

static void test_noise_goes_and_texture_stays(void) {
    measure();
    filter();
    double plain = error_of(0, WIDTH / 2 - 1, 0, HEIGHT), stripes = error_of(WIDTH / 2 + 1, WIDTH, 0, HEIGHT);
    CHECK_THAT(plain < 0.15 * (double)DEVIATION, "%.4f is left of %.4f", plain, (double)DEVIATION);
    CHECK_THAT(stripes < 0.3 * (double)DEVIATION, "stripes are off by %.4f", stripes);
    check_deviation(WIDTH / 2 + 1, WIDTH);
    double stated = stated_over(0, WIDTH / 2 - 1); /* peaks of noise are no edges */
    CHECK_THAT(stated < 2.0 * plain, "%.4f is stated of a plain wall, the error is %.4f", stated, plain);
    texture_release(&out);
}

/* Where there is no noise nothing changes; beside the border of a chart with strong texture hardly anything. */
static void test_no_noise(void) {
    for (uint32_t y = 0; y < HEIGHT; y++)
        for (uint32_t x = 0; x < WIDTH; x++)
            set(x, y, truth(x, y), 0.0f, 0.0f);
    filter();
    double plain = error_of(0, WIDTH / 2 - 1, 0, HEIGHT), stripes = error_of(WIDTH / 2 + 1, WIDTH, 0, HEIGHT);
    CHECK_THAT(plain < 1e-3 && stripes < 5e-3, "off by %.5f and %.5f", plain, stripes);
    texture_release(&out);
}

/* Noise that is the same over 16 x 16 texels, as the light of few rays is, goes from a plain wall as well. */
static void test_blotches(void) {
    for (uint32_t y = 0; y < HEIGHT; y++)
        for (uint32_t x = 0; x < WIDTH; x++) {
            uint32_t blotch = y / 16 * (WIDTH / 16) + x / 16;
            set(x, y, truth(x, y) + DEVIATION * normal(3, blotch), DEVIATION * normal(4, blotch), 0.0f);
        }
    filter();
    double plain = error_of(0, WIDTH / 2 - 1, 0, HEIGHT);
    CHECK_THAT(plain < 0.3 * (double)DEVIATION, "%.4f is left of %.4f", plain, (double)DEVIATION);
    texture_release(&out);
}

/* One texel that is far off is no texture, and does not keep the noise around it. */
static void test_outlier(void) {
    measure();
    set(60, 60, 3.5f, 0.1f, 0.0f);
    filter();
    CHECK_NEAR(out.texel[60 * WIDTH + 60][0], 0.8, 0.1);
    CHECK_THAT(error_of(55, 66, 55, 66) < 0.05 * (double)DEVIATION, "%.4f", error_of(55, 66, 55, 66));
    texture_release(&out);
}

/* Texels that are a hundred times less noisy are no better examples of what is around them: here they are all in dark
 * stripes. */
static void test_few_certain(void) {
    for (uint32_t y = 0; y < HEIGHT; y++)
        for (uint32_t x = 0; x < WIDTH; x++) {
            bool certain = x % 16 == 2 && y % 16 == 2;
            float noise = certain ? 0.02f * DEVIATION : 2.0f * DEVIATION;
            set(x, y, truth(x, y) + noise * normal(5, y * WIDTH + x), noise * normal(6, y * WIDTH + x), 0.0f);
            measured[y * WIDTH + x].weight = certain ? 1e4f : 1.0f;
        }
    filter();
    double stripes = error_of(WIDTH / 2 + 1, WIDTH, 0, HEIGHT);
    CHECK_THAT(stripes < 0.8 * (double)DEVIATION, "stripes are off by %.4f", stripes);
    texture_release(&out);
}

static void test_holes(void) {
    measure();
    for (uint32_t y = 40; y < 60; y++)
        for (uint32_t x = 40; x < 60; x++)
            measured[y * WIDTH + x] = (struct measurement){0};
    filter();
    CHECK_THAT(error_of(40, 60, 40, 60) < 0.3 * (double)DEVIATION, "%.4f", error_of(40, 60, 40, 60));
    texture_release(&out);
}

/* Three texels, of usual weight, hardly any and next to none, tell all of a chart. */
static void test_lonely(void) {
    for (uint32_t i = 0; i < TEXELS; i++)
        measured[i] = (struct measurement){0};
    for (uint32_t k = 0; k < 3; k++) {
        set(10 + 30 * k, 20 + 40 * k, 0.5f + 0.1f * (float)k, 0.01f, 0.0f);
        measured[(20 + 40 * k) * WIDTH + 10 + 30 * k].weight = k == 0 ? 1.0f : k == 1 ? 1e-16f : 1e-37f;
    }
    filter();
    for (uint32_t y = 0; y < HEIGHT; y++)
        for (uint32_t x = 0; x < WIDTH / 2 - 1; x++) {
            CHECK_NEAR(out.texel[y * WIDTH + x][1], 0.6f, 0.2f);
            CHECK(isfinite(image_float_from_half(deviation[y * WIDTH + x])));
        }
    texture_release(&out);
}

/* Beside much noise almost none: sums over it, run on, must not end below 0. */
static void test_silence(void) {
    for (uint32_t y = 0; y < HEIGHT; y++)
        for (uint32_t x = 0; x < WIDTH; x++) {
            float noise = x % (WIDTH / 2) < 24 ? 3.0f : 1e-7f;
            set(x, y, truth(x, y) + 0.01f * normal(8, y * WIDTH + x), noise * normal(9, y * WIDTH + x), 0.0f);
        }
    filter();
    for (uint32_t i = 0; i < TEXELS; i++)
        CHECK(isfinite(out.texel[i][1]) && isfinite(image_float_from_half(deviation[i])));
    texture_release(&out);
}

/* What is missing beside an edge is like its side of it, not like their mean. */
static void test_gap(void) {
    for (uint32_t y = 0; y < HEIGHT; y++)
        for (uint32_t x = 0; x < WIDTH; x++) {
            set(x, y, y < 64 ? 0.2f : 0.8f, 0.01f * normal(7, y * WIDTH + x), 0.0f);
            if (y >= 58 && y < 62)
                measured[y * WIDTH + x] = (struct measurement){0};
        }
    filter();
    for (uint32_t y = 58; y < 60; y++)
        CHECK_NEAR(out.texel[y * WIDTH + 60][1], 0.2f, 0.05f);
    texture_release(&out);
}

/* A chart of which nothing was measured has its prior; so has one that may be all light of others. */
static void test_prior(void) {
    measure();
    for (uint32_t y = 0; y < HEIGHT; y++)
        for (uint32_t x = 0; x < WIDTH / 2; x++)
            measured[y * WIDTH + x] = (struct measurement){0};
    filter();
    CHECK_NEAR(out.texel[64 * WIDTH + WIDTH / 2 - 2][0], 0.5, 1e-6);
    texture_release(&out);
    for (uint32_t y = 0; y < HEIGHT; y++)
        for (uint32_t x = 0; x < WIDTH / 2; x++)
            set(x, y, 0.9f, 0.01f, 5.0f);
    filter();
    CHECK_NEAR(out.texel[64 * WIDTH + 10][0], 0.5 + 0.4 * 0.05 / 5.05, 1e-3);
    texture_release(&out);
}

static void test_threads(void) {
    measure();
    filter();
    struct texture one = out;
    struct parallel *alone = pool;
    pool = parallel_new(3);
    filter();
    CHECK(memcmp(one.texel, out.texel, TEXELS * sizeof *one.texel) == 0);
    parallel_free(pool);
    pool = alone;
    texture_release(&one);
    texture_release(&out);
}

int main(void) {
    make_surface();
    measured = mem_calloc(TEXELS, sizeof *measured);
    pool = parallel_new(1);
    test_noise_goes_and_texture_stays();
    test_no_noise();
    test_blotches();
    test_outlier();
    test_few_certain();
    test_holes();
    test_gap();
    test_lonely();
    test_silence();
    test_prior();
    test_threads();
    parallel_free(pool);
    mem_free(measured);
    return check_result();
}
