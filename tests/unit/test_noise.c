/* noise.h: the noise of made-up photographs is found, and their texture is not taken for it. */
#include "server/capture/noise.h"

#include <string.h>

#include "common/image.h"
#include "common/mem.h"
#include "tests/check.h"
#include "tests/unit/normal.h"

#define SIDE 128
#define PIXELS (SIDE * SIDE)
#define PHOTOGRAPHS 4
#define BLOCKS ((SIDE / NOISE_BLOCK) * (SIDE / NOISE_BLOCK))

static struct photograph photograph[PHOTOGRAPHS];
static struct scene scene = {.photograph = photograph, .photograph_count = PHOTOGRAPHS};
static uint32_t train[PHOTOGRAPHS] = {0, 1, 2, 3};
static uint8_t edge_pixels[PIXELS], *edge[PHOTOGRAPHS];
static struct parallel *pool;
static struct views views = {.scene = &scene, .train_count = PHOTOGRAPHS, .train = train, .edge = edge};

/* Pictures of value(x, y) with noise of deviation(value, x). */
static void take(float (*value)(uint32_t x, uint32_t y), float (*deviation)(float value, uint32_t x)) {
    for (uint32_t t = 0; t < PHOTOGRAPHS; t++) {
        photograph[t].camera.width = photograph[t].camera.height = SIDE;
        photograph[t].exposure = 1.0f;
        photograph[t].gain = rgb_gray(1.0f);
        photograph[t].clip = INFINITY;
        photograph[t].is_hdr = true;
        if (!photograph[t].pixel)
            photograph[t].pixel = mem_array(PIXELS, sizeof *photograph[t].pixel);
        edge[t] = edge_pixels;
        for (uint32_t i = 0; i < PIXELS; i++) {
            float v = value(i % SIDE, i / SIDE);
            for (uint32_t c = 0; c < 3; c++)
                photograph[t].pixel[i][c] =
                    image_half_from_float(fmaxf(v + deviation(v, i % SIDE) * normal(3 * t + c, i), 0.0f));
        }
    }
}

static float share_at(const struct noise *noise, float x, float y, float radiance) {
    struct view view = {.train = 1, .x = x, .y = y};
    return rgb_mean(noise_deviation(noise, &views, &view, rgb_gray(radiance))) / radiance;
}

static float bright_and_dark(uint32_t x, uint32_t y) {
    (void)x;
    return y < SIDE / 2 ? 0.1f : 1.6f;
}

/* As of photons: the deviation is the root of the value. */
static float photons(float value, uint32_t x) {
    (void)x;
    return 0.05f * sqrtf(value);
}

static void test_photons(void) {
    struct noise noise;
    take(bright_and_dark, photons);
    noise_measure(&noise, &views, pool);
    CHECK(noise.black == 0.0f);
    CHECK_NEAR(share_at(&noise, 64.0f, 100.0f, 1.6f), 0.05 / sqrt(1.6), 0.006);
    CHECK_NEAR(share_at(&noise, 64.0f, 20.0f, 0.1f), 0.05 / sqrt(0.1), 0.025);
    /* Twice the noise: a quarter of the weight. */
    struct view dark = {.x = 64.0f, .y = 20.0f}, bright = {.x = 64.0f, .y = 100.0f};
    CHECK_NEAR(noise_weight(&noise, &views, &bright, rgb_gray(1.6f), 0.0f) /
                   noise_weight(&noise, &views, &dark, rgb_gray(0.1f), 0.0f),
               16.0, 5.0);
    CHECK_NEAR(noise_weight(&noise, &views, &bright, rgb_gray(1.6f), 0.25f), 4.0, 0.1);
    noise_release(&noise);
}

/* Waves of 24 pixels, a third of the brightness high. */
static float waves(uint32_t x, uint32_t y) { return 1.0f + 0.3f * sinf((float)x * 0.26f) * sinf((float)y * 0.26f); }

static float twice_as_much_on_the_right(float value, uint32_t x) { return value * (x < SIDE / 2 ? 0.05f : 0.1f); }

static void test_places_and_texture(void) {
    struct noise noise;
    take(waves, twice_as_much_on_the_right);
    noise_measure(&noise, &views, pool);
    float left = share_at(&noise, 20.0f, 40.0f, 1.0f), right = share_at(&noise, 100.0f, 40.0f, 1.0f);
    CHECK_NEAR(left, 0.05, 0.015);
    CHECK_NEAR(right, 0.1, 0.03);
    noise_release(&noise);
}

#define CODE (1.0f / (255.0f * 12.92f)) /* of 8 bits, where sRGB is a line */

/* Dark stripes, up to 8 codes bright. */
static float stripes(uint32_t x, uint32_t y) {
    static const float codes[8] = {0.0f, 0.25f, 0.5f, 1.0f, 2.0f, 4.0f, 6.0f, 8.0f};
    (void)x;
    return codes[y / 16] * CODE;
}

static float of_the_sensor(float value, uint32_t x) {
    (void)value, (void)x;
    return 1.2f * CODE;
}

/* Noise around black is cut off and rounded; what many such pixels read in the mean is right nevertheless, and
 * photographs that are held out or not of 8 bits read as they are stored. */
static void test_black(void) {
    struct noise noise;
    take(stripes, of_the_sensor);
    for (uint32_t t = 0; t < PHOTOGRAPHS; t++) {
        photograph[t].is_hdr = false;
        photograph[t].clip = 1.0f;
        for (uint32_t i = 0; i < 3 * PIXELS; i++) {
            float code = roundf(image_float_from_half(photograph[t].pixel[i / 3][i % 3]) / CODE);
            photograph[t].pixel[i / 3][i % 3] = image_half_from_float(code * CODE);
        }
    }
    photograph[2].is_hdr = photograph[3].is_test = true;
    noise_measure(&noise, &views, pool);
    noise_set_black(&noise, &scene);
    CHECK(photograph[0].black == noise.black && photograph[1].black == noise.black && photograph[2].black == 0.0f &&
          photograph[3].black == 0.0f);
    CHECK_NEAR(noise.black / CODE, 0.72, 0.15);
    for (uint32_t stripe = 0; stripe < 8; stripe++) {
        double sum = 0.0, stored = 0.0, truth = (double)stripes(0, 16 * stripe);
        for (uint32_t i = 16 * stripe * SIDE; i < 16 * (stripe + 1) * SIDE; i++) {
            struct photograph_sample s, as_stored;
            CHECK(photograph_sample(&photograph[0], (float)(i % SIDE) + 0.5f, (float)(i / SIDE) + 0.5f, &s) &&
                  photograph_sample(&photograph[3], (float)(i % SIDE) + 0.5f, (float)(i / SIDE) + 0.5f, &as_stored));
            sum += (double)rgb_mean(s.radiance) / (16.0 * SIDE);
            stored += (double)rgb_mean(as_stored.radiance) / (16.0 * SIDE);
        }
        CHECK_NEAR((sum - truth) / CODE, 0.0, 0.15);
        if (stripe == 0)
            CHECK((stored - truth) / CODE > 0.4);
    }
    photograph[3].is_test = false;
    noise_release(&noise);
}

/* Draws have the variance of a look-up: 1 at a pixel's middle, a quarter (cubic: 0.41) between four, and texels that
 * read the same pixels have the same. */
static void test_draw(void) {
    double middle = 0.0, between = 0.0, cubic = 0.0;
    for (uint32_t i = 0; i < 10000; i++) {
        struct view view = {.train = i / 100, .x = (float)(i % 100) + 0.5f, .y = 7.5f};
        double at = (double)noise_draw(&view, false);
        middle += at * at / 10000.0;
        CHECK(noise_draw(&view, false) == (float)at);
        view.x += 0.5f;
        view.y += 0.5f;
        between += (double)noise_draw(&view, false) * (double)noise_draw(&view, false) / 10000.0;
        cubic += (double)noise_draw(&view, true) * (double)noise_draw(&view, true) / 10000.0;
    }
    CHECK_NEAR(middle, 1.0, 1e-6);
    CHECK_NEAR(between, 0.25, 0.02);
    CHECK_NEAR(cubic, 0.41, 0.03); /* (2 x 9^2 + 2)^2 / 16^4 */
}

/* The same bytes on any number of threads; and as sure as so many pixels make it. */
static void test_threads(void) {
    struct parallel *three = parallel_new(3);
    struct noise one, other;
    take(bright_and_dark, photons);
    noise_measure(&one, &views, pool);
    noise_measure(&other, &views, three);
    CHECK(memcmp(one.share, other.share, sizeof one.share) == 0);
    for (uint32_t t = 0; t < PHOTOGRAPHS; t++)
        CHECK(memcmp(one.scale[t], other.scale[t], BLOCKS * sizeof *one.scale[t]) == 0);
    CHECK_NEAR(one.share[25] / (0.05 / sqrt(1.6)), 1.0, 0.02); /* 1 to 2; .6 % is one standard error */
    noise_release(&one);
    noise_release(&other);
    parallel_free(three);
}

int main(void) {
    pool = parallel_new(1);
    test_threads();
    test_photons();
    test_places_and_texture();
    test_black();
    test_draw();
    for (int t = 0; t < PHOTOGRAPHS; t++)
        mem_free(photograph[t].pixel);
    parallel_free(pool);
    return check_result();
}
