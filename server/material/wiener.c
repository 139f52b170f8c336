/* wiener.c -- see wiener.h. */
#include "server/material/wiener.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/material/patch_spectrum.h"

/* Radius of the square over which power is averaged, in steps of the coarsest octave, and at most in samples. */
#define WINDOW_STEPS 5 /* to 6: 0 dB */
#define MAX_WINDOW 48  /* of the coarse bands; +25 %: no change */
/* Factor on the noise power: noise of rare, far outliers locally exceeds that of its sample. */
#define NOISE_SAFETY 2.0f
/* Squared error beside an edge over the mean power of its details in 3 x 3 steps, of octaves finer than what was
 * resolved; of the finest octave that was resolved half of that. For scale: an ideal step of height 1 has .07 of that
 * power, and a place that is off by half a sample has it wrong by .25 in the mean. Chosen on the demo room and
 * staircase2 among 2, 1 and .6: of the demo room's errors (256 texels, all measured) 81, 77 and 74 % are within one
 * deviation. No other room has judged it. */
#define UNRESOLVED 0.6f
/* Share of the samples around that exceed POWER_BOUND from which these are texture, not outliers: of normal noise 1e-5
 * do. */
#define TEXTURE_SHARE 0.1f
/* Clip of a sample's power, in variances of its noise: 3 standard deviations; 4: within .05 dB, passage's specks 1.04 %
 * for .84. */
#define POWER_BOUND 9.0f

/* A quotient of planes below it would be of denormal numbers. */
#define MIN_WEIGHT 1e-30f

/* The planes of scratch that have one value a sample. */
#define WIENER_SCRATCH(w)                                                                                              \
    {                                                                                                                  \
        &(w)->error, &(w)->power, &(w)->bounded_power, &(w)->noise_power, &(w)->relative_noise, &(w)->weight_sum,      \
            &(w)->count, &(w)->trust, &(w)->variance, &(w)->mixing, &(w)->filled, &(w)->outliers, &(w)->scratch        \
    }

void wiener_init(struct wiener *w, size_t samples) {
    *w = (struct wiener){.inside = mem_array(samples, sizeof *w->inside)};
    for (int p = 0; p < WIENER_PLANES; p++) {
        w->plane[p] = mem_array(samples, sizeof(float));
        w->fine[p] = mem_array(samples, sizeof(float));
        w->coarse[p] = mem_array(samples, sizeof(float));
    }
    for (int c = 0; c < 3; c++)
        w->kept[c] = mem_array(samples, sizeof(float));
    float **plane[] = WIENER_SCRATCH(w);
    for (size_t i = 0; i < sizeof plane / sizeof *plane; i++)
        *plane[i] = mem_array(samples, sizeof(float));
}

void wiener_release(struct wiener *w) {
    mem_free(w->inside);
    for (int p = 0; p < WIENER_PLANES; p++) {
        mem_free(w->plane[p]);
        mem_free(w->fine[p]);
        mem_free(w->coarse[p]);
    }
    for (int c = 0; c < 3; c++)
        mem_free(w->kept[c]);
    float **plane[] = WIENER_SCRATCH(w);
    for (size_t i = 0; i < sizeof plane / sizeof *plane; i++)
        mem_free(*plane[i]);
    *w = (struct wiener){0};
}

/* --- smoothing ---------------------------------------------------------------------------------- */

static const float tap[5] = {1.0f / 16.0f, 4.0f / 16.0f, 6.0f / 16.0f, 4.0f / 16.0f, 1.0f / 16.0f};

/* One row or column of the B3 spline at `step` samples between taps; `to` is not `from`. */
static void smooth_rows(float *to, const float *from, size_t width, size_t height, size_t step) {
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

static void smooth_columns(float *to, const float *from, size_t width, size_t height, size_t step) {
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

/* --- details ------------------------------------------------------------------------------------ */

/* The difference of two smoothings of the picture. */
struct details {
    struct wiener *w;
    float *const *of, *const *less; /* [WIENER_PLANES] */
};

static float detail(const struct details *d, int plane, size_t at) {
    return d->of[plane][at] / d->of[WIENER_WEIGHT][at] - d->less[plane][at] / d->less[WIENER_WEIGHT][at];
}

/* Of the three planes from `first` on. */
static float detail_power(const struct details *d, int first, size_t at) {
    float power = 0.0f;
    for (int p = first; p < first + 3; p++)
        power += detail(d, p, at) * detail(d, p, at);
    return power;
}

static bool counts(const struct details *d, size_t at) {
    return d->w->inside[at] && d->of[WIENER_WEIGHT][at] > MIN_WEIGHT;
}

/* Of a sample's noise, up to a factor: after smoothing that of the samples that it is the mean of. */
static float variance_of(const struct details *d, size_t at) {
    return d->of[WIENER_VARIANCE][at] / d->of[WIENER_WEIGHT][at];
}

/* Noise variance of a sample's detail: its own, up to the factor that the noise around tells, whose running sums may
 * end a little below 0. */
static float noise_variance(const struct details *d, size_t at) {
    return fmaxf(d->w->relative_noise[at], 0.0f) / d->w->count[at] * variance_of(d, at);
}

/* Noise power around each sample, and the sums that normalise it. */
static void measure_noise(const struct details *d, size_t radius) {
    struct wiener *w = d->w;
    for (size_t at = 0; at < w->width * w->height; at++) {
        float weight = counts(d, at) ? d->of[WIENER_WEIGHT][at] : 0.0f;
        float power = weight > 0.0f ? detail_power(d, WIENER_NOISE, at) : 0.0f;
        w->noise_power[at] = weight * power;
        w->relative_noise[at] = power > 0.0f ? power / variance_of(d, at) : 0.0f;
        w->weight_sum[at] = weight;
        w->count[at] = weight > 0.0f ? 1.0f : 0.0f;
    }
    float *plane[] = {w->noise_power, w->relative_noise, w->weight_sum, w->count};
    for (size_t i = 0; i < sizeof plane / sizeof *plane; i++)
        window_sums(plane[i], w->scratch, w->width, w->height, radius);
}

/* Power of the value around each sample, and the same with each sample clipped. */
static void measure_power(const struct details *d, size_t radius) {
    struct wiener *w = d->w;
    for (size_t at = 0; at < w->width * w->height; at++) {
        float power = 0.0f, bound = 0.0f;
        if (counts(d, at)) {
            power = detail_power(d, WIENER_VALUE, at);
            bound = POWER_BOUND * noise_variance(d, at);
        }
        w->power[at] = d->of[WIENER_WEIGHT][at] * power;
        w->bounded_power[at] = d->of[WIENER_WEIGHT][at] * fminf(power, bound);
        w->outliers[at] = power > bound ? 1.0f : 0.0f;
    }
    window_sums(w->outliers, w->scratch, w->width, w->height, radius);
    window_sums(w->power, w->scratch, w->width, w->height, radius);
    window_sums(w->bounded_power, w->scratch, w->width, w->height, radius);
}

/* Whether what is far off around a sample is texture: then it is too much to be outliers. */
static bool is_texture(const struct wiener *w, size_t at) { return w->outliers[at] > TEXTURE_SHARE * w->count[at]; }

/* --- what was too fine ---------------------------------------------------------------------------- */

/* Adds the error of detail that is too fine to be resolved: where the finest that is resolved has edges. Where there is
 * no texture there are none: peaks of noise alone, above what is subtracted, have a quarter of its power in the
 * mean. */
static void add_unresolved(const struct details *d, size_t step, float part) {
    struct wiener *w = d->w;
    measure_noise(d, WINDOW_STEPS * step);
    measure_power(d, WINDOW_STEPS * step);
    for (size_t at = 0; at < w->width * w->height; at++) {
        bool is_there = counts(d, at);
        float power = is_there ? detail_power(d, WIENER_VALUE, at) - NOISE_SAFETY * noise_variance(d, at) : 0.0f;
        float around = is_texture(w, at) ? w->power[at] : w->bounded_power[at];
        w->trust[at] = power > 0.0f && around > NOISE_SAFETY * w->noise_power[at] ? power : 0.0f;
        w->mixing[at] = is_there ? 1.0f : 0.0f;
    }
    window_sums(w->trust, w->scratch, w->width, w->height, step);
    window_sums(w->mixing, w->scratch, w->width, w->height, step);
    for (size_t at = 0; at < w->width * w->height; at++)
        if (counts(d, at))
            w->error[at] += part * UNRESOLVED * w->trust[at] / w->mixing[at];
}

/* --- a band -------------------------------------------------------------------------------------- */

static void swap_planes(float **a, float **b) {
    for (int p = 0; p < WIENER_PLANES; p++) {
        float *was = a[p];
        a[p] = b[p];
        b[p] = was;
    }
}

/* From `plane` to `coarse`. */
static void smooth(struct wiener *w, size_t step) {
    for (int p = 0; p < WIENER_PLANES; p++) {
        smooth_rows(w->scratch, w->plane[p], w->width, w->height, step);
        smooth_columns(w->coarse[p], w->scratch, w->width, w->height, step);
    }
}

/* Of samples that `fine` lacks, what is in `plane`: the finest low-pass that reaches them. It is theirs once
 * count_filled gives them the weight of it. */
static void fill(struct wiener *w) {
    for (size_t at = 0; at < w->width * w->height; at++) {
        float weight = w->plane[WIENER_WEIGHT][at];
        if (!w->inside[at] || w->fine[WIENER_WEIGHT][at] > 0.0f || w->filled[at] > 0.0f || !(weight > MIN_WEIGHT))
            continue;
        w->filled[at] = weight;
        for (int p = 0; p < WIENER_WEIGHT; p++)
            w->fine[p][at] = w->plane[p][at];
    }
}

static void count_filled(struct wiener *w) {
    for (size_t at = 0; at < w->width * w->height; at++)
        w->fine[WIENER_WEIGHT][at] += w->filled[at];
}

/* Leaves what was in `plane` in `fine`, and its low-pass in `plane`. */
static void split(struct wiener *w, size_t step, int octaves, size_t resolution) {
    memset(w->filled, 0, w->width * w->height * sizeof *w->filled);
    for (int octave = 0; octave < octaves; octave++, step *= 2) {
        smooth(w, step);
        if (step <= resolution)
            add_unresolved(&(struct details){w, w->plane, w->coarse}, step, step == resolution ? 0.5f : 1.0f);
        swap_planes(w->plane, w->coarse);
        if (octave == 0)
            swap_planes(w->coarse, w->fine);
        fill(w);
    }
}

/* What is far off its surroundings by chance, as no texture is, is brought nearer. */
static float clip_of(const struct details *d, size_t at) {
    float power = detail_power(d, WIENER_VALUE, at), bound = POWER_BOUND * noise_variance(d, at);
    return power > bound && !is_texture(d->w, at) ? sqrtf(bound / power) : 1.0f;
}

/* Samples that count for less than those around are trusted by that share; filled ones, which are means, wholly. */
static float trust_of(const struct details *d, size_t at) {
    const struct wiener *w = d->w;
    float weight = d->of[WIENER_WEIGHT][at];
    float usual = fmaxf(w->weight_sum[at], weight) / w->count[at]; /* a running sum may lose what is small */
    return w->filled[at] > 0.0f ? 1.0f : fminf(1.0f, weight / usual);
}

/* Of the details, in the place of `fine`, what is kept. */
static void filter_details(const struct details *d, size_t step, size_t resolution) {
    struct wiener *w = d->w;
    struct patch_spectrum p = {.width = w->width,
                               .height = w->height,
                               .step = step,
                               .block = resolution,
                               .trust = w->trust,
                               .variance = w->variance,
                               .mixing = w->mixing,
                               .error = w->error};
    for (int c = 0; c < 3; c++) {
        p.value[c] = w->fine[WIENER_VALUE + c];
        p.noise[c] = w->fine[WIENER_NOISE + c];
    }
    for (size_t at = 0; at < w->width * w->height; at++) {
        bool is_there = counts(d, at);
        float weight = d->of[WIENER_WEIGHT][at], clip = is_there ? clip_of(d, at) : 0.0f;
        w->trust[at] = is_there ? trust_of(d, at) : 0.0f;
        w->variance[at] = is_there ? variance_of(d, at) : 0.0f;
        w->mixing[at] = is_there ? d->of[WIENER_MIXING][at] / weight : 0.0f;
        for (int c = 0; c < 3; c++) {
            float value = is_there ? detail(d, WIENER_VALUE + c, at) : 0.0f;
            float noise = is_there ? detail(d, WIENER_NOISE + c, at) : 0.0f;
            p.value[c][at] = clip * value;
            p.noise[c][at] = noise;
        }
    }
    patch_spectrum_filter(&p);
}

void wiener_band(struct wiener *w, size_t step, int octaves, size_t resolution) {
    const struct details d = {w, w->fine, w->plane};
    size_t radius = WINDOW_STEPS * (step << (WIENER_OCTAVES - 1));
    if (radius > MAX_WINDOW)
        radius = MAX_WINDOW;
    split(w, step, octaves, resolution);
    measure_noise(&d, radius);
    measure_power(&d, radius);
    count_filled(w);
    filter_details(&d, step, resolution);
    for (size_t at = 0; at < w->width * w->height; at++)
        for (int c = 0; c < 3 && counts(&d, at); c++)
            w->kept[c][at] += w->fine[WIENER_VALUE + c][at];
}

size_t wiener_reach(size_t step) {
    size_t smoothing = 2 * ((step << WIENER_OCTAVES) - step); /* to either side, of all splines */
    size_t window = WINDOW_STEPS * (step << (WIENER_OCTAVES - 1));
    return smoothing + (window < MAX_WINDOW ? window : MAX_WINDOW) + PATCH_SPECTRUM_REACH * step;
}
