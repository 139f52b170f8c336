/* metrics.c -- see metrics.h. */
#include "server/reconstruct/metrics.h"

#include <math.h>

#define WINDOW 8 /* pixels a side of SSIM's windows, which overlap by half */

static bool pixel_is_finite(const float *a, const float *b) {
    for (int c = 0; c < 3; c++) {
        if (!isfinite(a[c]) || !isfinite(b[c]))
            return false;
    }
    return true;
}

/* Mean of `square` over the channels of valid pixels. */
static double mean_square(const struct image *photograph, const struct image *render,
                          double (*square)(float photograph, float render, double parameter), double parameter) {
    size_t pixels = (size_t)photograph->width * photograph->height, count = 0;
    double sum = 0.0;
    for (size_t i = 0; i < pixels; i++) {
        const float *r = photograph->pixel + 3 * i, *v = render->pixel + 3 * i;
        if (!pixel_is_finite(r, v))
            continue;
        for (int c = 0; c < 3; c++)
            sum += square(r[c], v[c], parameter);
        count += 3;
    }
    return count ? sum / (double)count : (double)NAN;
}

static double relative_square(float photograph, float render, double median) {
    double r = (double)photograph, difference = (double)render - r;
    return difference * difference / (r * r + 0.01 * median * median);
}

double metrics_msre(const struct image *photograph, const struct image *render, double median) {
    return mean_square(photograph, render, relative_square, median);
}

static double relative_noise(float photograph, float deviation, double median) {
    double r = (double)photograph, d = (double)deviation;
    return d * d / (r * r + 0.01 * median * median);
}

double metrics_msre_noise(const struct image *photograph, const struct image *deviation, double median) {
    return mean_square(photograph, deviation, relative_noise, median);
}

static double displayed(float radiance, double exposure) {
    return (double)image_linear_to_srgb(fminf(fmaxf(radiance * (float)exposure, 0.0f), 1.0f));
}

static double displayed_square(float photograph, float render, double exposure) {
    double difference = displayed(render, exposure) - displayed(photograph, exposure);
    return difference * difference;
}

double metrics_psnr_db(const struct image *photograph, const struct image *render, double exposure) {
    return 10.0 * log10(1.0 / mean_square(photograph, render, displayed_square, exposure));
}

static double luminance(const struct image *image, size_t pixel, double exposure) {
    const float *p = image->pixel + 3 * pixel;
    return 0.2126 * displayed(p[0], exposure) + 0.7152 * displayed(p[1], exposure) + 0.0722 * displayed(p[2], exposure);
}

/* Similarity of one window; NaN when it holds a non-finite pixel. */
static double window_ssim(const struct image *a, const struct image *b, uint32_t x0, uint32_t y0, double exposure) {
    const double n = WINDOW * WINDOW, c1 = 0.01 * 0.01, c2 = 0.03 * 0.03;
    double sa = 0, sb = 0, saa = 0, sbb = 0, sab = 0;
    for (uint32_t y = y0; y < y0 + WINDOW; y++) {
        for (uint32_t x = x0; x < x0 + WINDOW; x++) {
            size_t pixel = (size_t)y * a->width + x;
            if (!pixel_is_finite(a->pixel + 3 * pixel, b->pixel + 3 * pixel))
                return NAN;
            double va = luminance(a, pixel, exposure), vb = luminance(b, pixel, exposure);
            sa += va;
            sb += vb;
            saa += va * va;
            sbb += vb * vb;
            sab += va * vb;
        }
    }
    double ma = sa / n, mb = sb / n;
    double va = saa / n - ma * ma, vb = sbb / n - mb * mb, cov = sab / n - ma * mb;
    return (2 * ma * mb + c1) * (2 * cov + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
}

double metrics_ssim(const struct image *photograph, const struct image *render, double exposure) {
    double sum = 0.0;
    size_t count = 0;
    for (uint32_t y = 0; y + WINDOW <= photograph->height; y += WINDOW / 2) {
        for (uint32_t x = 0; x + WINDOW <= photograph->width; x += WINDOW / 2) {
            double s = window_ssim(photograph, render, x, y, exposure);
            if (!isfinite(s))
                continue;
            sum += s;
            count++;
        }
    }
    return count ? sum / (double)count : (double)NAN;
}
