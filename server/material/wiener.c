/* wiener.c -- see wiener.h. */
#include "server/material/wiener.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"

/* Radius of the square over which power is averaged, in steps of the level's filter. */
#define WINDOW_STEPS 5 /* to 6: 0 dB */
/* Factor on the noise power: noise of rare, far outliers locally exceeds that of its sample. */
#define NOISE_SAFETY 2.0f /* +25 %: -0.03 dB */
/* Squared error beside an edge over the mean power of its details in 3 x 3 steps, of levels finer than what was
 * resolved; of the finest level that was resolved half of that. For scale: an ideal step of height 1 has .07 of that
 * power, and a place that is off by half a sample has it wrong by .25 in the mean. Chosen on the demo room and
 * staircase2 among 2, 1 and .6: of the demo room's errors (256 texels, all measured) 81, 77 and 74 % are within one
 * deviation. No other room has judged it. */
#define UNRESOLVED 0.6f
/* Clipped power over noise power from which samples above POWER_BOUND count as texture, not as outliers. */
#define TEXTURE_CERTAIN 2.0f /* +25 %: -0.02 dB */
/* Clip of a sample's power, in variances of its noise: 3 standard deviations. */
#define POWER_BOUND 9.0f /* +25 %: +0.04 dB */

void wiener_init(struct wiener *w, size_t samples) {
    *w = (struct wiener){.inside = mem_array(samples, sizeof *w->inside)};
    for (int p = 0; p < WIENER_PLANES; p++) {
        w->plane[p] = mem_array(samples, sizeof(float));
        w->coarse[p] = mem_array(samples, sizeof(float));
    }
    for (int c = 0; c < 3; c++)
        w->kept[c] = mem_array(samples, sizeof(float));
    float **plane[] = {&w->error,      &w->power, &w->bounded_power, &w->noise_power,
                       &w->weight_sum, &w->count, &w->scratch};
    for (size_t i = 0; i < sizeof plane / sizeof *plane; i++)
        *plane[i] = mem_array(samples, sizeof(float));
}

void wiener_release(struct wiener *w) {
    mem_free(w->inside);
    for (int p = 0; p < WIENER_PLANES; p++) {
        mem_free(w->plane[p]);
        mem_free(w->coarse[p]);
    }
    for (int c = 0; c < 3; c++)
        mem_free(w->kept[c]);
    float *plane[] = {w->error, w->power, w->bounded_power, w->noise_power, w->weight_sum, w->count, w->scratch};
    for (size_t i = 0; i < sizeof plane / sizeof *plane; i++)
        mem_free(plane[i]);
    *w = (struct wiener){0};
}

/* --- smoothing ---------------------------------------------------------------------------------- */

/* One row or column of the B3 spline at `step` samples between taps; `to` is not `from`. */
static void spline_rows(float *to, const float *from, size_t width, size_t height, size_t step) {
    static const float tap[5] = {1.0f / 16.0f, 4.0f / 16.0f, 6.0f / 16.0f, 4.0f / 16.0f, 1.0f / 16.0f};
    for (size_t y = 0; y < height; y++) {
        const float *in = from + y * width;
        float *out = to + y * width;
        memset(out, 0, width * sizeof *out);
        for (long k = -2; k <= 2; k++) {
            long shift = k * (long)step;
            size_t first = shift < 0 ? (size_t)-shift : 0;
            size_t end = shift > 0 ? (width > (size_t)shift ? width - (size_t)shift : 0) : width;
            for (size_t x = first; x < end; x++)
                out[x] += tap[k + 2] * in[(long)x + shift];
        }
    }
}

static void spline_columns(float *to, const float *from, size_t width, size_t height, size_t step) {
    static const float tap[5] = {1.0f / 16.0f, 4.0f / 16.0f, 6.0f / 16.0f, 4.0f / 16.0f, 1.0f / 16.0f};
    for (size_t y = 0; y < height; y++) {
        float *out = to + y * width;
        memset(out, 0, width * sizeof *out);
        for (long k = -2; k <= 2; k++) {
            long row = (long)y + k * (long)step;
            if (row < 0 || row >= (long)height)
                continue;
            const float *in = from + (size_t)row * width;
            for (size_t x = 0; x < width; x++)
                out[x] += tap[k + 2] * in[x];
        }
    }
}

/* Sums over the square of `radius` samples around each; in place. */
static void window_sums(float *plane, float *scratch, size_t width, size_t height, size_t radius) {
    for (size_t y = 0; y < height; y++) {
        const float *in = plane + y * width;
        double sum = 0.0;
        for (size_t x = 0; x < radius && x < width; x++)
            sum += (double)in[x];
        for (size_t x = 0; x < width; x++) {
            sum += x + radius < width ? (double)in[x + radius] : 0.0;
            scratch[y * width + x] = (float)sum;
            sum -= x >= radius ? (double)in[x - radius] : 0.0;
        }
    }
    for (size_t x = 0; x < width; x++) {
        double sum = 0.0;
        for (size_t y = 0; y < radius && y < height; y++)
            sum += (double)scratch[y * width + x];
        for (size_t y = 0; y < height; y++) {
            sum += y + radius < height ? (double)scratch[(y + radius) * width + x] : 0.0;
            plane[y * width + x] = (float)sum;
            sum -= y >= radius ? (double)scratch[(y - radius) * width + x] : 0.0;
        }
    }
}

/* --- one level ---------------------------------------------------------------------------------- */

static float detail(const struct wiener *w, int plane, size_t at) {
    return w->plane[plane][at] / w->plane[WIENER_WEIGHT][at] - w->coarse[plane][at] / w->coarse[WIENER_WEIGHT][at];
}

/* Of the three planes from `first` on. */
static float detail_power(const struct wiener *w, int first, size_t at) {
    float power = 0.0f;
    for (int p = first; p < first + 3; p++)
        power += detail(w, p, at) * detail(w, p, at);
    return power;
}

static bool counts(const struct wiener *w, size_t at) { return w->inside[at] && w->plane[WIENER_WEIGHT][at] > 0.0f; }

/* Noise variance of a sample's detail: local noise power, scaled by the sample's own weight. */
static float noise_variance(const struct wiener *w, size_t at) {
    return w->noise_power[at] / (w->count[at] * w->plane[WIENER_WEIGHT][at]);
}

/* Noise power around each sample, and the sums that normalise it. */
static void measure_noise(struct wiener *w, size_t radius) {
    size_t samples = w->width * w->height;
    for (size_t at = 0; at < samples; at++) {
        float weight = counts(w, at) ? w->plane[WIENER_WEIGHT][at] : 0.0f;
        w->noise_power[at] = weight > 0.0f ? weight * detail_power(w, WIENER_NOISE, at) : 0.0f;
        w->weight_sum[at] = weight;
        w->count[at] = weight > 0.0f ? 1.0f : 0.0f;
    }
    float *plane[] = {w->noise_power, w->weight_sum, w->count};
    for (size_t i = 0; i < sizeof plane / sizeof *plane; i++)
        window_sums(plane[i], w->scratch, w->width, w->height, radius);
}

/* Power of the value around each sample, and the same with each sample clipped. */
static void measure_power(struct wiener *w, size_t radius) {
    size_t samples = w->width * w->height;
    for (size_t at = 0; at < samples; at++) {
        float power = 0.0f, bound = 0.0f;
        if (counts(w, at)) {
            power = detail_power(w, WIENER_VALUE, at);
            bound = POWER_BOUND * noise_variance(w, at);
        }
        w->power[at] = w->plane[WIENER_WEIGHT][at] * power;
        w->bounded_power[at] = w->plane[WIENER_WEIGHT][at] * fminf(power, bound);
    }
    window_sums(w->power, w->scratch, w->width, w->height, radius);
    window_sums(w->bounded_power, w->scratch, w->width, w->height, radius);
}

/* Power of texture around a sample: power less noise, with outliers clipped unless they are too many to be outliers. */
static float texture_power(const struct wiener *w, size_t at) {
    float noise = w->noise_power[at], bounded = w->bounded_power[at];
    float power = bounded < TEXTURE_CERTAIN * noise ? bounded : w->power[at];
    return fmaxf(power - NOISE_SAFETY * noise, 0.0f) / w->weight_sum[at];
}

/* Adds this level's detail by its share of texture. Of noise the same share is kept and of
 * texture the rest is lost, which makes keep^2 noise + (1 - keep)^2 texture = keep noise. */
static void keep_texture(struct wiener *w) {
    size_t samples = w->width * w->height;
    for (size_t at = 0; at < samples; at++) {
        if (!counts(w, at))
            continue;
        float texture = texture_power(w, at);
        float noise = noise_variance(w, at) + w->plane[WIENER_MIXING][at] / w->plane[WIENER_WEIGHT][at];
        float keep = texture > 0.0f ? texture / (texture + noise) : 0.0f;
        w->error[at] += keep * noise;
        for (int c = 0; c < 3; c++)
            w->kept[c][at] += keep * detail(w, WIENER_VALUE + c, at);
    }
}

/* Adds the error of detail that is too fine to be resolved: where the finest that is resolved has edges. Where there is
 * no texture there are none: peaks of noise alone, above what is subtracted, have a quarter of its power in the
 * mean. */
static void add_unresolved(struct wiener *w, size_t step, float part) {
    size_t samples = w->width * w->height;
    for (size_t at = 0; at < samples; at++) {
        bool is_there = counts(w, at);
        float power = is_there ? detail_power(w, WIENER_VALUE, at) - NOISE_SAFETY * noise_variance(w, at) : 0.0f;
        w->power[at] = power > 0.0f && texture_power(w, at) > 0.0f ? power : 0.0f;
        w->bounded_power[at] = is_there ? 1.0f : 0.0f;
    }
    window_sums(w->power, w->scratch, w->width, w->height, step);
    window_sums(w->bounded_power, w->scratch, w->width, w->height, step);
    for (size_t at = 0; at < samples; at++)
        if (counts(w, at))
            w->error[at] += part * UNRESOLVED * w->power[at] / w->bounded_power[at];
}

static void take_level(struct wiener *w, size_t step, size_t radius, size_t resolution) {
    for (int p = 0; p < WIENER_PLANES; p++) {
        spline_rows(w->scratch, w->plane[p], w->width, w->height, step);
        spline_columns(w->coarse[p], w->scratch, w->width, w->height, step);
    }
    measure_noise(w, radius);
    measure_power(w, radius);
    keep_texture(w);
    if (step <= resolution)
        add_unresolved(w, step, step == resolution ? 0.5f : 1.0f);
    for (int p = 0; p < WIENER_PLANES; p++) {
        float *was = w->plane[p];
        w->plane[p] = w->coarse[p];
        w->coarse[p] = was;
    }
}

static size_t radius_of(size_t step, size_t max_window) {
    return WINDOW_STEPS * step < max_window ? WINDOW_STEPS * step : max_window;
}

void wiener_levels(struct wiener *w, size_t step, int levels, size_t max_window, size_t resolution) {
    for (int level = 0; level < levels; level++, step *= 2)
        take_level(w, step, radius_of(step, max_window), resolution);
}

size_t wiener_reach(size_t step, int levels, size_t max_window) {
    size_t reach = 0, widest = 0;
    for (int level = 0; level < levels; level++, step *= 2) {
        reach += 2 * step; /* to either side, of the spline */
        widest = radius_of(step, max_window);
    }
    return reach + widest;
}
