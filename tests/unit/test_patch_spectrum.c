/* patch_spectrum.h in closed form: of noise alone almost nothing is kept; of a wave in noise the share of texture;
 * what has no noise is kept as it is, on each of the lattices; one mark that noise does not explain stays in its
 * place; where samples are missing or hardly trusted, the wave goes on. Nothing depends on what is further than it
 * says. */
#include "server/material/patch_spectrum.h"

#include <math.h>
#include <string.h>

#include "tests/check.h"
#include "tests/unit/normal.h"

#define WIDTH 320
#define HEIGHT 96
#define SAMPLES (WIDTH * HEIGHT)
#define NOISE 0.1f

static float value[3][SAMPLES], noise[3][SAMPLES], trust[SAMPLES], variance[SAMPLES], mixing[SAMPLES], error[SAMPLES];

static float wave(size_t at, float amplitude) {
    return amplitude * sinf(1.3f * (float)(at % WIDTH) + 0.4f * (float)(at / WIDTH));
}

/* A wave of the amplitude, with noise of the deviation. */
static void set(float amplitude, float deviation) {
    memset(error, 0, sizeof error);
    memset(mixing, 0, sizeof mixing);
    for (size_t i = 0; i < SAMPLES; i++) {
        trust[i] = 1.0f;
        variance[i] = 1.0f; /* up to a factor */
        for (uint32_t c = 0; c < 3; c++) {
            value[c][i] = wave(i, amplitude) + deviation * normal(1 + c, (uint32_t)i);
            noise[c][i] = deviation * normal(4 + c, (uint32_t)i);
        }
    }
}

static void filter_blocks(size_t step, size_t block) {
    struct patch_spectrum p = {.width = WIDTH,
                               .height = HEIGHT,
                               .step = step,
                               .block = block,
                               .value = {value[0], value[1], value[2]},
                               .noise = {noise[0], noise[1], noise[2]},
                               .trust = trust,
                               .variance = variance,
                               .mixing = mixing,
                               .error = error};
    patch_spectrum_filter(&p);
}

static void filter(size_t step) { filter_blocks(step, 1); }

/* Mean squares, of a channel: what the wave is off by, what is stated, and what is kept. */
static void sums(float amplitude, double *off, double *stated, double *kept) {
    *off = *stated = *kept = 0.0;
    for (size_t i = 0; i < SAMPLES; i++) {
        double d = (double)(value[1][i] - wave(i, amplitude));
        *off += d * d / SAMPLES;
        *stated += (double)error[i] / 3.0 / SAMPLES;
        *kept += (double)(value[1][i] * value[1][i]) / SAMPLES;
    }
}

static void test_noise(void) {
    double off, stated, kept;
    set(0.0f, NOISE);
    filter(1);
    sums(0.0f, &off, &stated, &kept);
    CHECK_THAT(kept < 1e-4 * (double)(NOISE * NOISE), "of noise %.2g is kept", kept / (double)(NOISE * NOISE));
}

/* Of noise that blocks of 2 x 2 samples share as little is kept. */
static void test_blocks(void) {
    double off, stated, kept;
    set(0.0f, NOISE);
    for (size_t i = 0; i < SAMPLES; i++)
        for (size_t c = 0; c < 3; c++) {
            size_t from = i / WIDTH / 2 * 2 * WIDTH + i % WIDTH / 2 * 2;
            value[c][i] = value[c][from];
            noise[c][i] = noise[c][from];
        }
    filter_blocks(1, 2);
    sums(0.0f, &off, &stated, &kept);
    CHECK_THAT(kept < 3e-4 * (double)(NOISE * NOISE), "of noise in blocks %.2g is kept",
               kept / (double)(NOISE * NOISE));
}

/* As strong as the noise: nearly all of the wave is kept, of the noise what lies in its few coefficients. */
static void test_wave(void) {
    double off, stated, kept;
    set(NOISE * sqrtf(2.0f), NOISE);
    filter(1);
    sums(NOISE * sqrtf(2.0f), &off, &stated, &kept);
    printf("a wave as strong as noise: off by %.3f of it, %.3f is stated\n", off / (double)(NOISE * NOISE),
           stated / (double)(NOISE * NOISE));
    CHECK_THAT(off < 0.15 * (double)(NOISE * NOISE), "%g", off);
    CHECK_THAT(stated > 0.5 * off && stated < 2.0 * off, "%g is stated of %g", stated, off);
}

/* Texture that is as strong at all frequencies, of 1.5 times the power of the noise: no coefficient stands out. */
static void test_even_texture(void) {
    double off, stated, kept;
    set(0.0f, NOISE);
    for (size_t i = 0; i < SAMPLES; i++)
        for (uint32_t c = 0; c < 3; c++)
            value[c][i] += sqrtf(1.5f) * NOISE * normal(7 + c, (uint32_t)i);
    filter(1);
    sums(0.0f, &off, &stated, &kept);
    CHECK_THAT(kept > 0.15 * (double)(NOISE * NOISE), "of even texture %.2g is kept", kept / (double)(NOISE * NOISE));
}

static void test_without_noise(void) {
    for (size_t step = 1; step <= 3; step++) {
        set(1.0f, 0.0f);
        filter(step);
        for (size_t i = 0; i < SAMPLES; i++)
            CHECK_NEAR(value[1][i], wave(i, 1.0f), 1e-5f);
    }
}

static void test_mark(void) {
    set(0.0f, NOISE);
    const size_t at = 40 * WIDTH + 100;
    for (size_t c = 0; c < 3; c++)
        for (size_t y = 0; y < 4; y++)
            for (size_t x = 0; x < 4; x++)
                value[c][at + y * WIDTH + x] += 10.0f * NOISE;
    filter(1);
    float there = value[1][at + WIDTH + 1], beside = value[1][at + 40];
    CHECK_THAT(there > 6.0f * NOISE && fabsf(beside) < NOISE, "%g, %g", (double)there, (double)beside);
}

/* Where noise hides the gap: without it, a gap is texture. */
static void test_trust(void) {
    const float amplitude = 2.0f * NOISE;
    const size_t missing = 40 * WIDTH + 100, doubtful = 40 * WIDTH + 200;
    set(amplitude, NOISE);
    for (size_t k = 0; k < 4; k++)
        for (size_t c = 0; c < 3; c++) {
            trust[missing + k] = 0.0f;
            value[c][missing + k] = noise[c][missing + k] = 0.0f;
            trust[doubtful + k] = 0.01f;
            variance[doubtful + k] = 1e4f;
            value[c][doubtful + k] = 3.0f; /* far off */
        }
    filter(1);
    for (size_t k = 0; k < 4; k++) {
        CHECK_NEAR(value[1][missing + k], wave(missing + k, amplitude), 0.6f * amplitude);
        CHECK_NEAR(value[1][doubtful + k], wave(doubtful + k, amplitude), 0.6f * amplitude);
    }
}

/* Where nothing is trusted beside what is, or nothing has noise, all is finite. */
static void test_hardly_trusted(void) {
    set(1.0f, NOISE);
    for (size_t i = 0; i < SAMPLES; i++)
        if (i % WIDTH > 160) {
            trust[i] = 1e-12f;
            variance[i] = 1e-8f;
        }
    filter(1);
    for (size_t i = 0; i < SAMPLES; i++)
        CHECK(isfinite(value[1][i]) && isfinite(error[i]));
    set(0.0f, 0.0f);
    filter(1);
    for (size_t i = 0; i < SAMPLES; i++)
        CHECK(value[1][i] == 0.0f && error[i] == 0.0f);
}

/* Changes one sample, which is one with noise only in the first run. */
static void test_reach(void) {
    static float before[WIDTH];
    const size_t row = 40 * WIDTH;
    set(NOISE, NOISE);
    filter(1);
    memcpy(before, &value[1][row], sizeof before);
    set(NOISE, NOISE);
    for (size_t c = 0; c < 3; c++) {
        noise[c][row + 20] *= 100.0f;
        value[c][row + 20] = 5.0f;
    }
    filter(1);
    size_t last = 0;
    for (size_t x = 20; x < WIDTH; x++)
        if (before[x] != value[1][row + x])
            last = x;
    CHECK_THAT(last > 20 + 16 && last <= 20 + PATCH_SPECTRUM_REACH, "changed up to %zu", last - 20);
    printf("one sample changes others up to %zu samples away\n", last - 20);
}

int main(void) {
    test_noise();
    test_blocks();
    test_wave();
    test_even_texture();
    test_without_noise();
    test_mark();
    test_trust();
    test_hardly_trusted();
    test_reach();
    return check_result();
}
