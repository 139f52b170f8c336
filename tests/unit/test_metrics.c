/* metrics.h against values worked out by hand. */
#include "server/reconstruct/metrics.h"

#include "tests/check.h"

static void fill(struct image *image, float value) {
    image_init_rgb(image, 16, 16);
    for (size_t i = 0; i < 16 * 16 * 3; i++)
        image->pixel[i] = value;
}

int main(void) {
    struct image photograph, render;
    fill(&photograph, 0.5f);
    fill(&render, 0.6f);
    /* (0.1)^2 / (0.25 + 0.01 * 4) */
    CHECK_NEAR(metrics_msre(&photograph, &render, 2.0), 0.01 / 0.29, 1e-6);
    CHECK_NEAR(metrics_msre_noise(&photograph, &render, 2.0), 0.36 / 0.29, 1e-6);
    /* sRGB(0.5) = 0.735357, sRGB(0.6) = 0.797738 */
    double wanted = -20.0 * log10(0.797738 - 0.735357);
    CHECK_NEAR(metrics_psnr_db(&photograph, &render, 1.0), wanted, 1e-3);
    CHECK(isinf(metrics_psnr_db(&photograph, &photograph, 1.0)));
    CHECK_NEAR(metrics_ssim(&photograph, &photograph, 1.0), 1.0, 1e-9);
    /* Constant pictures: only the luminance term, (2ab + c1) / (a^2 + b^2 + c1). */
    double a = 0.735357, b = 0.797738, c1 = 1e-4;
    CHECK_NEAR(metrics_ssim(&photograph, &render, 1.0), (2 * a * b + c1) / (a * a + b * b + c1), 1e-4);
    /* A pixel that cannot be used does not count. */
    photograph.pixel[0] = NAN;
    render.pixel[1] = 1e9f;
    CHECK_NEAR(metrics_msre(&photograph, &render, 2.0), 0.01 / 0.29, 1e-6);
    /* Where no pixel can be used, nothing was measured: that is no perfect score. */
    for (size_t i = 0; i < 16 * 16 * 3; i++)
        photograph.pixel[i] = NAN;
    CHECK(isnan(metrics_msre(&photograph, &render, 2.0)));
    CHECK(isnan(metrics_psnr_db(&photograph, &render, 1.0)));
    CHECK(isnan(metrics_ssim(&photograph, &render, 1.0)));
    image_release(&photograph);
    image_release(&render);
    return check_result();
}
