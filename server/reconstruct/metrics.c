/* metrics.c -- see metrics.h. */
#include "server/reconstruct/metrics.h"

#include <assert.h>
#include <math.h>

#define WINDOW 8            /* pixels a side of SSIM's windows, which overlap by half */
#define RELATIVE_FLOOR 0.01 /* times the squared median, in the denominator of MSRE */

static bool pixel_is_finite(const float *value, int count) {
    for (int c = 0; c < count; c++) {
        if (!isfinite(value[c]))
            return false;
    }
    return true;
}

/* The errors of both re-renders at one channel of one pixel, scaled as the metric has them. */
struct error_pair {
    double a, b;
};
typedef struct error_pair pair_error(float photograph, float a, float b, double parameter);

/* Mean of the product of both errors over the channels of valid pixels. Channels of a pixel have common noise, pixels
 * have not. */
static struct metric mean_product(const struct image *photograph, const struct image *halves, pair_error *error,
                                  double parameter) {
    size_t pixels = (size_t)photograph->width * photograph->height, count = 0;
    double sum = 0.0, variance = 0.0;
    assert(halves->channel_count == 6);
    for (size_t i = 0; i < pixels; i++) {
        const float *r = photograph->pixel + 3 * i, *v = halves->pixel + 6 * i;
        double varies = 0.0;
        if (!pixel_is_finite(r, 3) || !pixel_is_finite(v, 6))
            continue;
        for (int c = 0; c < 3; c++) {
            struct error_pair e = error(r[c], v[c], v[3 + c], parameter);
            sum += e.a * e.b;
            varies += 0.5 * (e.a + e.b) * (e.a - e.b);
        }
        variance += varies * varies;
        count += 3;
    }
    if (count == 0)
        return (struct metric){(double)NAN, (double)NAN};
    return (struct metric){sum / (double)count, sqrt(variance) / (double)count};
}

static double relative_to(double radiance, double median) {
    return 1.0 / sqrt(radiance * radiance + RELATIVE_FLOOR * median * median);
}

static struct error_pair relative_error(float photograph, float a, float b, double median) {
    double r = (double)photograph, scale = relative_to(r, median);
    return (struct error_pair){((double)a - r) * scale, ((double)b - r) * scale};
}

struct metric metrics_msre(const struct image *photograph, const struct image *halves, double median) {
    return mean_product(photograph, halves, relative_error, median);
}

double metrics_brightness_error(const struct image *photograph, const struct image *halves) {
    double of_photograph = 0.0, a = 0.0, b = 0.0;
    for (size_t i = 0; i < (size_t)photograph->width * photograph->height; i++) {
        const float *r = photograph->pixel + 3 * i, *v = halves->pixel + 6 * i;
        for (int c = 0; c < 3 && pixel_is_finite(r, 3) && pixel_is_finite(v, 6); c++) {
            of_photograph += (double)r[c];
            a += (double)v[c];
            b += (double)v[3 + c];
        }
    }
    return of_photograph > 0.0 && a > 0.0 && b > 0.0 ? log(a / of_photograph) * log(b / of_photograph) : (double)NAN;
}

/* Half of the difference, twice. */
static struct error_pair relative_noise(float photograph, float a, float b, double median) {
    double half = 0.5 * ((double)a - (double)b) * relative_to((double)photograph, median);
    return (struct error_pair){half, half};
}

double metrics_msre_of_renders(const struct image *photograph, const struct image *halves, double median) {
    return mean_product(photograph, halves, relative_noise, median).value;
}

double metrics_msre_of_photograph(const struct image *photograph, const struct image *deviation, double median) {
    size_t pixels = (size_t)photograph->width * photograph->height, count = 0;
    double sum = 0.0;
    for (size_t i = 0; i < pixels; i++) {
        const float *r = photograph->pixel + 3 * i, *d = deviation->pixel + 3 * i;
        if (!pixel_is_finite(r, 3) || !pixel_is_finite(d, 3))
            continue;
        for (int c = 0; c < 3; c++) {
            double relative = (double)d[c] * relative_to((double)r[c], median);
            sum += relative * relative;
        }
        count += 3;
    }
    return count ? sum / (double)count : (double)NAN;
}

static double displayed(double radiance, double exposure) {
    if (!isfinite(radiance))
        return (double)NAN;
    return (double)image_linear_to_srgb((float)fmin(fmax(radiance * exposure, 0.0), 1.0));
}

/* By how much display, which is concave, is darkened by a pixel's noise: in the mean by f''(x) v / 2 to second order
 * for noise of variance v, of which the mean of both re-renders has half. */
static double display_bias(const float *halves, int channel, double exposure) {
    double a = (double)halves[channel], b = (double)halves[3 + channel];
    double bias = displayed(a, exposure) + displayed(b, exposure) - 2.0 * displayed(0.5 * (a + b), exposure);
    return isfinite(bias) ? bias : 0.0;
}

/* What both re-renders show, without that bias. It is taken from a neighbour to the left for a, to the right for b, so
 * that both remain independent; at the border from two pixels inside. *shown is the caller's. */
static void display_halves(const struct image *halves, double exposure, struct image *shown) {
    image_copy(halves, shown);
    for (uint32_t y = 0; y < halves->height; y++) {
        const float *row = halves->pixel + 6 * (size_t)y * halves->width;
        float *out = shown->pixel + 6 * (size_t)y * halves->width;
        for (uint32_t x = 0; x < halves->width; x++) {
            uint32_t last = halves->width - 1, far = last < 2 ? x : x < 2 ? x + 2 : x - 2;
            uint32_t left = x > 0 ? x - 1 : far, right = x < last ? x + 1 : far;
            for (int c = 0; c < 6; c++)
                out[6 * x + (uint32_t)c] =
                    (float)(displayed((double)row[6 * x + (uint32_t)c], exposure) -
                            display_bias(row + 6 * (size_t)(c < 3 ? left : right), c % 3, exposure));
        }
    }
}

static struct error_pair displayed_error(float photograph, float a, float b, double exposure) {
    double r = displayed((double)photograph, exposure);
    return (struct error_pair){(double)a - r, (double)b - r};
}

struct metric metrics_psnr_db(const struct image *photograph, const struct image *halves, double exposure) {
    struct image shown;
    display_halves(halves, exposure, &shown);
    struct metric square = mean_product(photograph, &shown, displayed_error, exposure);
    double least = fmax(square.value, square.noise);
    image_release(&shown);
    if (isnan(square.value))
        return square;
    return (struct metric){-10.0 * log10(least), least > 0.0 ? 10.0 / log(10.0) * square.noise / least : 0.0};
}

static const double to_luminance[3] = {0.2126, 0.7152, 0.0722};

/* Sums over a window: of the photograph's luminance r, those of both renders, and products. */
struct window_sums {
    double r, a, b, rr, ab, ra, rb;
};

static void add_pixel(struct window_sums *s, const float *photograph, const float *shown, double exposure) {
    double r = 0.0, a = 0.0, b = 0.0;
    for (int c = 0; c < 3; c++) {
        r += to_luminance[c] * displayed((double)photograph[c], exposure);
        a += to_luminance[c] * (double)shown[c];
        b += to_luminance[c] * (double)shown[3 + c];
    }
    s->r += r, s->a += a, s->b += b;
    s->rr += r * r, s->ab += a * b, s->ra += r * a, s->rb += r * b;
}

/* Similarity of one window; NaN when it holds a non-finite pixel. Noise may bring it above 1. */
static double window_ssim(const struct image *photograph, const struct image *shown, uint32_t x0, uint32_t y0,
                          double exposure) {
    const double n = WINDOW * WINDOW, c1 = 0.01 * 0.01, c2 = 0.03 * 0.03;
    struct window_sums s = {0};
    for (uint32_t y = y0; y < y0 + WINDOW; y++) {
        for (uint32_t x = x0; x < x0 + WINDOW; x++) {
            size_t pixel = (size_t)y * photograph->width + x;
            const float *p = photograph->pixel + 3 * pixel, *h = shown->pixel + 6 * pixel;
            if (!pixel_is_finite(p, 3) || !pixel_is_finite(h, 6))
                return NAN;
            add_pixel(&s, p, h, exposure);
        }
    }
    double mr = s.r / n, ma = s.a / n, mb = s.b / n, mean = 0.5 * (ma + mb);
    double vr = s.rr / n - mr * mr, v = fmax(s.ab / n - ma * mb, 0.0), cov = 0.5 * (s.ra + s.rb) / n - mr * mean;
    return (2 * mr * mean + c1) * (2 * cov + c2) / ((mr * mr + ma * mb + c1) * (vr + v + c2));
}

double metrics_ssim(const struct image *photograph, const struct image *halves, double exposure) {
    struct image shown;
    double sum = 0.0;
    size_t count = 0;
    display_halves(halves, exposure, &shown);
    for (uint32_t y = 0; y + WINDOW <= photograph->height; y += WINDOW / 2) {
        for (uint32_t x = 0; x + WINDOW <= photograph->width; x += WINDOW / 2) {
            double s = window_ssim(photograph, &shown, x, y, exposure);
            if (!isfinite(s))
                continue;
            sum += s;
            count++;
        }
    }
    image_release(&shown);
    return count ? fmin(sum / (double)count, 1.0) : (double)NAN;
}
