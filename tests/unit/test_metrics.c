/* metrics.h against values worked out by hand, and on pictures of known error under noise of a known size. */
#include "server/reconstruct/metrics.h"

#include "common/rng.h"
#include "tests/check.h"

static const char *const half_names[] = {"a.R", "a.G", "a.B", "b.R", "b.G", "b.B"};

static void fill(struct image *image, float value) {
    for (size_t i = 0; i < (size_t)image->width * image->height * image->channel_count; i++)
        image->pixel[i] = value;
}

static void test_by_hand(void) {
    struct image photograph, halves, deviation;
    image_init_rgb(&photograph, 16, 16);
    image_init_rgb(&deviation, 16, 16);
    image_init(&halves, 16, 16, 6, half_names);
    fill(&photograph, 0.5f);
    fill(&halves, 0.6f);
    fill(&deviation, 0.6f);
    /* (0.1)^2 / (0.25 + 0.01 * 4) */
    struct metric msre = metrics_msre(&photograph, &halves, 2.0);
    CHECK_NEAR(msre.value, 0.01 / 0.29, 1e-6);
    CHECK(msre.noise == 0.0);
    CHECK(metrics_msre_of_renders(&photograph, &halves, 2.0) == 0.0);
    CHECK_NEAR(metrics_msre_of_photograph(&photograph, &deviation, 2.0), 0.36 / 0.29, 1e-6);
    /* sRGB(0.5) = 0.735357, sRGB(0.6) = 0.797738 */
    CHECK_NEAR(metrics_psnr_db(&photograph, &halves, 1.0).value, -20.0 * log10(0.797738 - 0.735357), 1e-3);
    /* Constant pictures: only the luminance term, (2ab + c1) / (a^2 + b^2 + c1). */
    CHECK_NEAR(metrics_brightness_error(&photograph, &halves), log(1.2) * log(1.2), 1e-6);
    double a = 0.735357, b = 0.797738, c1 = 1e-4;
    CHECK_NEAR(metrics_ssim(&photograph, &halves, 1.0), (2 * a * b + c1) / (a * a + b * b + c1), 1e-4);
    /* Both halves off by as much, to either side: no error that is known of. */
    for (size_t i = 0; i < 16 * 16 * 6; i++)
        halves.pixel[i] = i % 6 < 3 ? 0.6f : 0.4f;
    CHECK_NEAR(metrics_msre(&photograph, &halves, 2.0).value, -0.01 / 0.29, 1e-6);
    CHECK_NEAR(metrics_msre_of_renders(&photograph, &halves, 2.0), 0.01 / 0.29, 1e-6);
    CHECK_NEAR(metrics_brightness_error(&photograph, &halves), log(1.2) * log(0.8), 1e-6);
    /* A pixel that cannot be used does not count. */
    fill(&halves, 0.6f);
    photograph.pixel[0] = NAN;
    halves.pixel[1] = halves.pixel[5] = 1e9f;
    CHECK_NEAR(metrics_msre(&photograph, &halves, 2.0).value, 0.01 / 0.29, 1e-6);
    CHECK_NEAR(metrics_brightness_error(&photograph, &halves), log(1.2) * log(1.2), 1e-6);
    fill(&halves, 0.5f);
    CHECK(isinf(metrics_psnr_db(&photograph, &halves, 1.0).value));
    CHECK_NEAR(metrics_ssim(&photograph, &halves, 1.0), 1.0, 1e-9);
    /* Where no pixel can be used, nothing was measured: that is no perfect score. */
    fill(&photograph, NAN);
    CHECK(isnan(metrics_msre(&photograph, &halves, 2.0).value));
    CHECK(isnan(metrics_brightness_error(&photograph, &halves)));
    CHECK(isnan(metrics_psnr_db(&photograph, &halves, 1.0).value));
    CHECK(isnan(metrics_ssim(&photograph, &halves, 1.0)));
    image_release(&photograph);
    image_release(&deviation);
    image_release(&halves);
}

#define SIDE 64
#define RENDERS 100

struct known_scene {
    struct image photograph, halves;
};

/* A wall of gentle contrast, of which all renders are too bright by a twentieth; `noise` is the standard deviation of
 * one of the two, relative to radiance and common to the channels of a pixel. */
static void render_known(struct known_scene *k, float noise, uint64_t seed) {
    for (size_t i = 0; i < SIDE * SIDE; i++) {
        float base = 0.3f + 0.1f * sinf(0.3f * (float)(i % SIDE)) * cosf(0.2f * (float)(i / SIDE));
        for (size_t half = 0; half < 2; half++) {
            float sum = 0.0f; /* of twelve even numbers: nearly Gaussian, variance 1 */
            for (uint64_t n = 0; n < 12; n++)
                sum += rng_to_float((uint32_t)(rng_key(seed, i, 16 * half + n) >> 32)) - 0.5f;
            for (size_t c = 0; c < 3; c++)
                k->halves.pixel[6 * i + 3 * half + c] = 1.05f * base * (1.0f + noise * sum);
        }
        for (size_t c = 0; c < 3; c++)
            k->photograph.pixel[3 * i + c] = base;
    }
}

/* Noise of four times the error's size: the mean of many figures is that without noise, and they vary as they say. A
 * square of the mean picture's error would be nine times too large. */
static void test_free_of_noise(void) {
    struct known_scene k;
    double sum = 0.0, squares = 0.0, told = 0.0, of_renders = 0.0, ssim = 0.0, psnr = 0.0;
    image_init_rgb(&k.photograph, SIDE, SIDE);
    image_init(&k.halves, SIDE, SIDE, 6, half_names);
    render_known(&k, 0.0f, 0);
    double exact = metrics_msre(&k.photograph, &k.halves, 0.3).value;
    double exact_ssim = metrics_ssim(&k.photograph, &k.halves, 1.0);
    double exact_psnr = metrics_psnr_db(&k.photograph, &k.halves, 1.0).value;
    for (uint64_t r = 0; r < RENDERS; r++) {
        render_known(&k, 0.2f, r + 1);
        struct metric m = metrics_msre(&k.photograph, &k.halves, 0.3);
        sum += m.value / RENDERS;
        squares += m.value * m.value / RENDERS;
        told += m.noise * m.noise / RENDERS;
        of_renders += metrics_msre_of_renders(&k.photograph, &k.halves, 0.3) / RENDERS;
        ssim += metrics_ssim(&k.photograph, &k.halves, 1.0) / RENDERS;
        psnr += metrics_psnr_db(&k.photograph, &k.halves, 1.0).value / RENDERS;
    }
    double deviation = sqrt((squares - sum * sum) / RENDERS); /* of the mean of all */
    printf("MSRE %g +- %g, without noise %g; of one render more by %g; SSIM %g, %g; PSNR %g, %g dB\n", sum, deviation,
           exact, of_renders, ssim, exact_ssim, psnr, exact_psnr);
    CHECK_THAT(fabs(sum - exact) < 4.0 * deviation, "%g, not %g", sum, exact);
    CHECK_THAT(fabs(sum / exact - 1.0) < 0.02, "%g, not %g", sum, exact);
    CHECK_THAT(of_renders > 7.0 * exact, "%g", of_renders); /* so that taking it out is worth while */
    CHECK_THAT(fabs(told / (squares - sum * sum) - 1.0) < 0.3, "told %g, found %g", told, squares - sum * sum);
    CHECK_THAT(fabs(ssim - exact_ssim) < 0.02, "SSIM %g, not %g", ssim, exact_ssim);
    CHECK_THAT(fabs(psnr - exact_psnr) < 0.5, "PSNR %g, not %g", psnr, exact_psnr);
    image_release(&k.photograph);
    image_release(&k.halves);
}

int main(void) {
    test_by_hand();
    test_free_of_noise();
    return check_result();
}
