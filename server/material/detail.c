/* detail.c -- see detail.h.
 *
 * Pixels are processed on all threads. Their contributions to texels are summed in integers, whose result does not
 * depend on the order. */
#include "server/material/detail.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/capture/halves.h"
#include "server/material/footprint.h"
#include "server/scene/rgb_half.h"

#define CHUNK 4096 /* texels a work item */
#define STRIDE 16  /* pixels between those of which the footprint's size is taken; +25 %: no change */
#define NONE UINT32_MAX
/* Least part of a pixel's footprint that must be known. */
#define MIN_KNOWN 0.75f /* +25 %: +0.04 dB */
/* Radius of the high-pass filter, pixels, and least number of pixels in its window. */
#define WINDOW 5         /* to 6: -0.01 dB */
#define MIN_WINDOW 12.0f /* +25 %: 0 dB */
/* Bound of one pixel's residual, base colour. */
#define MAX_RESIDUAL 0.2f /* +25 %: -0.02 dB */
/* Added to base colour where a pixel's noise is estimated from it: highlights are noisy, too. */
#define SPECULAR_FLOOR 0.1f /* +25 %: +0.01 dB */
/* Splits of the photographs into halves; a split counts for a texel if the lesser half has this part of its weight. */
#define SPLITS 4       /* +25 %: +0.01 dB */
#define MIN_HALF 0.15f /* +25 %: +0.01 dB */
/* Radius over which the halves' agreement is averaged, texels, and the weight of their disagreement as noise: it is low
 * because part of it is a difference of sharpness. */
#define AGREEMENT_RADIUS 4 /* +25 %: +0.02 dB */
#define DISAGREEMENT 0.04f /* +25 %: +0.01 dB */
#define MIN_SHARE 0.05f    /* a lower share counts as 0; +25 %: 0 dB */
/* Scales of the integer sums: COUNT_SCALE until the greatest sum of weights is known, then the largest that cannot
 * overflow. Weights differ by orders of magnitude: with a coarse scale the least are lost, and steps are too long. */
#define COUNT_SCALE 4096.0f
#define MAX_SUM 1e9f /* +25 %: 0 dB */

enum { RED, GREEN, BLUE, SUMS };
enum { WEIGHT, RESIDUAL };   /* the sums while shares are measured: weights, and weighted residuals */
#define ALL_PHOTOGRAPHS (-1) /* in place of a split */

/* One photograph being processed. */
struct picture_job {
    struct detail *detail;
    uint32_t train;
    rgb *raw; /* [pixels] residual before the high-pass filter */
};

static const struct photograph *photograph_of(const struct detail *d, uint32_t train) {
    return &d->in.views->scene->photograph[d->in.views->train[train]];
}

static size_t pixels_of(const struct detail *d, uint32_t train) {
    const struct camera *camera = &photograph_of(d, train)->camera;
    return (size_t)camera->width * camera->height;
}

/* Calls body for each row of a photograph. */
static void for_rows(struct detail *d, uint32_t train, void (*body)(void *user, size_t row, int thread)) {
    struct picture_job job = {.detail = d, .train = train};
    parallel_for(d->in.pool, photograph_of(d, train)->camera.height, body, &job);
}

/* Of the arrays with an element a pixel. */
static struct spill *spill_of(const struct detail *d) { return d->in.views->scene->spill; }

/* Tells that a row's residuals are looked at or written next. */
static void use_row(const struct detail *d, uint32_t train, size_t row) {
    size_t width = photograph_of(d, train)->camera.width, at = row * width;
    spill_use(spill_of(d), d->triangle[train] + at, width * sizeof **d->triangle);
    spill_use(spill_of(d), d->weight[train] + at, width * sizeof **d->weight);
    spill_use(spill_of(d), d->residual[train] + at, width * sizeof **d->residual);
}

static size_t chunks_of(const struct detail *d) { return (d->in.surface.inverse->valid_count + CHUNK - 1) / CHUNK; }

/* The texels in the footprint of a pixel that shows a triangle; false where too few of them are known. */
static bool pixel_footprint(const struct detail *d, uint32_t train, uint32_t x, uint32_t y, uint32_t triangle,
                            struct footprint_texels *t) {
    const struct surface *s = &d->in.surface;
    struct footprint f;
    return triangle != NONE &&
           footprint_of_triangle(&f, s->mesh, s->atlas, &photograph_of(d, train)->camera, x, y, triangle) &&
           footprint_texels(t, &f, s->atlas->chart_of_triangle[triangle], d->chart_of_texel, s->inverse->width,
                            s->inverse->height) >= MIN_KNOWN;
}

static void add_to(_Atomic int32_t *sum, float what) {
    atomic_fetch_add_explicit(sum, (int32_t)lrintf(what), memory_order_relaxed);
}

/* --- residuals ---------------------------------------------------------------------------------- */

static rgb divided(rgb over, rgb under) { return rgb_make(over.r / under.r, over.g / under.g, over.b / under.b); }

/* The triangle that a pixel shows; NONE for emitters, mixed pixels, fireflies and saturated pixels. */
static uint32_t pixel_triangle(const struct detail *d, uint32_t train, uint32_t x, uint32_t y, rgb *observed) {
    const struct photograph *photo = photograph_of(d, train);
    const struct surface *s = &d->in.surface;
    struct photograph_sample sample;
    struct footprint f;
    float cx = (float)x + 0.5f, cy = (float)y + 0.5f;
    if (d->in.views->edge[train][(size_t)y * photo->camera.width + x] > 0 || photograph_has_firefly(photo, cx, cy) ||
        !photograph_sample(photo, cx, cy, &sample) || photograph_sample_saturates(&sample) ||
        !footprint_find(&f, s->mesh, s->atlas, d->in.views->accel, &photo->camera, x, y) ||
        d->in.is_emitter[s->segments->of_triangle[f.triangle]])
        return NONE;
    *observed = sample.radiance;
    return f.triangle;
}

/* Inverse noise variance of a pixel's residual in units of base colour. */
static float weight_of(const struct detail *d, const struct photograph *photo, rgb predicted, rgb lambert) {
    rgb bright = rgb_mad(rgb_clamp(predicted, 0.0f, INFINITY), SPECULAR_FLOOR, lambert);
    float dark = SPECULAR_FLOOR * rgb_mean(lambert) / rgb_mean(bright);
    return noise_weight_of_brightness(d->in.noise, photo, bright) * dark * dark;
}

/* Residual of each pixel as base colour. It is clamped: a single far too bright pixel, as path tracers leave, would
 * darken its surroundings through the high-pass filter. */
static void residual_row(void *user, size_t row, int thread) {
    (void)thread;
    const struct picture_job *job = user;
    struct detail *d = job->detail;
    const struct photograph *photo = photograph_of(d, job->train);
    struct footprint_texels t;
    use_row(d, job->train, row);
    views_use(d->in.views, job->train, row * photo->camera.width, photo->camera.width);
    for (uint32_t x = 0; x < photo->camera.width; x++) {
        size_t at = row * photo->camera.width + x;
        rgb observed = rgb_gray(0.0f), predicted = observed, lambert = observed;
        uint32_t triangle = pixel_triangle(d, job->train, x, (uint32_t)row, &observed);
        d->triangle[job->train][at] = NONE;
        if (!pixel_footprint(d, job->train, x, (uint32_t)row, triangle, &t))
            continue;
        for (size_t i = 0; i < t.count; i++) {
            rgb part = rgb_scale(rgb_from_half(d->in.lambert[t.texel[i]]), t.share[i]);
            lambert = rgb_add(lambert, part);
            predicted = rgb_add(predicted, rgb_mul(part, rgb_from_half(d->in.measured[t.texel[i]].value)));
        }
        d->triangle[job->train][at] = triangle;
        d->weight[job->train][at] = weight_of(d, photo, predicted, lambert);
        job->raw[at] = rgb_clamp(divided(rgb_sub(observed, predicted), lambert), -MAX_RESIDUAL, MAX_RESIDUAL);
    }
}

/* High-pass filter: subtracts the mean over the same segment's pixels around each. */
static void filter_row(void *user, size_t row, int thread) {
    (void)thread;
    const struct picture_job *job = user;
    const struct camera *camera = &photograph_of(job->detail, job->train)->camera;
    const uint8_t *owner = job->detail->in.views->owner[job->train];
    const uint32_t *triangle = job->detail->triangle[job->train];
    long width = (long)camera->width, height = (long)camera->height, y0 = (long)row;
    for (long y = y0 > WINDOW ? y0 - WINDOW : 0; y <= y0 + WINDOW && y < height; y++) {
        use_row(job->detail, job->train, (size_t)y);
        views_use(job->detail->in.views, job->train, (size_t)(y * width), (size_t)width);
    }
    for (long x0 = 0; x0 < width; x0++) {
        size_t at = (size_t)(y0 * width + x0);
        rgb sum = rgb_gray(0.0f), residual = rgb_gray(NAN);
        float count = 0.0f;
        for (long y = y0 > WINDOW ? y0 - WINDOW : 0; triangle[at] != NONE && y <= y0 + WINDOW && y < height; y++) {
            for (long x = x0 > WINDOW ? x0 - WINDOW : 0; x <= x0 + WINDOW && x < width; x++) {
                size_t near = (size_t)(y * width + x);
                if (triangle[near] == NONE || owner[near] != owner[at])
                    continue;
                sum = rgb_add(sum, job->raw[near]);
                count += 1.0f;
            }
        }
        if (count >= MIN_WINDOW)
            residual = rgb_mad(job->raw[at], -1.0f / count, sum);
        rgb_to_half(job->detail->residual[job->train][at], residual);
    }
}

/* --- agreement of photographs ------------------------------------------------------------------- */

static void clear_sums(struct detail *d) {
    for (size_t i = 0; i < d->in.surface.inverse->valid_count; i++)
        for (int k = 0; k < SUMS; k++)
            d->sum[d->in.surface.inverse->valid[i]][k] = 0;
}

/* Adds each pixel's weight and weighted residual to the texels of its footprint. */
static void weigh_row(void *user, size_t row, int thread) {
    (void)thread;
    const struct picture_job *job = user;
    struct detail *d = job->detail;
    uint32_t width = photograph_of(d, job->train)->camera.width, train = job->train;
    struct footprint_texels t;
    use_row(d, train, row);
    for (uint32_t x = 0; x < width; x++) {
        size_t at = row * width + x;
        if (!pixel_footprint(d, train, x, (uint32_t)row, d->triangle[train][at], &t))
            continue;
        float residual = rgb_mean(rgb_from_half(d->residual[train][at])), weight = d->sum_scale * d->weight[train][at];
        for (size_t i = 0; i < t.count; i++) {
            add_to(&d->sum[t.texel[i]][WEIGHT], weight * t.share[i]);
            add_to(&d->sum[t.texel[i]][RESIDUAL], weight * t.share[i] * residual);
        }
    }
}

/* Sums over all photographs, or over those of the first half of a split. */
static void sum_weighted(struct detail *d, int split, float scale) {
    clear_sums(d);
    d->sum_scale = scale;
    for (uint32_t t = 0; t < d->in.views->train_count; t++)
        if (split == ALL_PHOTOGRAPHS || halves_of(t, split) == 0)
            for_rows(d, t, weigh_row);
}

/* Sums over the splits: the square of a texel's mean residual, and the product of the halves' mean residuals. */
struct agreement {
    float square, common;
};

struct agreement_job {
    struct detail *detail;
    float *residual;             /* [height][width] the sum over all photographs */
    struct agreement *agreement; /* [height][width] */
};

static double scaled(const struct detail *d, size_t texel, int sum) {
    return (double)d->sum[texel][sum] / (double)d->sum_scale;
}

/* Adds one split, where both halves have enough weight. */
static void agree_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct agreement_job *a = user;
    const struct detail *d = a->detail;
    const struct inverse_uv *inverse = d->in.surface.inverse;
    for (size_t i = chunk * CHUNK; i < (chunk + 1) * CHUNK && i < inverse->valid_count; i++) {
        uint32_t texel = inverse->valid[i];
        double all = (double)d->weight_sum[texel];
        double weight[2] = {scaled(d, texel, WEIGHT)}, residual[2] = {scaled(d, texel, RESIDUAL)};
        weight[1] = all - weight[0];
        residual[1] = (double)a->residual[texel] - residual[0];
        if (!(all > 0.0) || fmin(weight[0], weight[1]) < MIN_HALF * all)
            continue;
        double mean = (double)a->residual[texel] / all;
        a->agreement[texel].square += (float)(mean * mean);
        a->agreement[texel].common += (float)(residual[0] / weight[0] * (residual[1] / weight[1]));
    }
}

/* Share of a texel's residual that is not noise. */
static float signal_share_of(const struct agreement_job *a, uint32_t texel) {
    const struct detail *d = a->detail;
    long width = (long)d->in.surface.inverse->width, height = (long)d->in.surface.inverse->height;
    long x0 = (long)texel % width, y0 = (long)texel / width;
    double square = 0.0, common = 0.0;
    if (!(a->agreement[texel].square > 0.0f))
        return 0.0f;
    for (long y = y0 - AGREEMENT_RADIUS; y <= y0 + AGREEMENT_RADIUS; y++) {
        for (long x = x0 - AGREEMENT_RADIUS; x <= x0 + AGREEMENT_RADIUS; x++) {
            size_t at = (size_t)(y * width + x);
            if (x < 0 || y < 0 || x >= width || y >= height || d->chart_of_texel[at] != d->chart_of_texel[texel])
                continue;
            square += (double)a->agreement[at].square;
            common += (double)a->agreement[at].common;
        }
    }
    double noise = DISAGREEMENT * fmax(square - common, 0.0);
    float share = common > 0.0 ? (float)(common / (common + noise)) : 0.0f;
    return share < MIN_SHARE ? 0.0f : share;
}

static void share_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct agreement_job *a = user;
    struct detail *d = a->detail;
    const struct inverse_uv *inverse = d->in.surface.inverse;
    for (size_t i = chunk * CHUNK; i < (chunk + 1) * CHUNK && i < inverse->valid_count; i++)
        if (d->chart_of_texel[inverse->valid[i]] != NONE)
            d->signal_share[inverse->valid[i]] = signal_share_of(a, inverse->valid[i]);
}

/* Sums the weights of each texel, and chooses the scale of sums by the greatest. */
static void sum_weights(struct detail *d) {
    float most = 0.0f;
    sum_weighted(d, ALL_PHOTOGRAPHS, COUNT_SCALE);
    for (size_t i = 0; i < d->in.surface.inverse->valid_count; i++)
        most = fmaxf(most, (float)scaled(d, d->in.surface.inverse->valid[i], WEIGHT));
    sum_weighted(d, ALL_PHOTOGRAPHS, MAX_SUM / fmaxf(most, 1.0f));
    for (size_t i = 0; i < d->in.surface.inverse->valid_count; i++)
        d->weight_sum[d->in.surface.inverse->valid[i]] = (float)scaled(d, d->in.surface.inverse->valid[i], WEIGHT);
}

/* Finds the share of each texel's residual on which the photographs agree. Expects the sums over all photographs, as
 * sum_weights leaves them. */
static void find_shares(struct detail *d, size_t texels) {
    struct agreement_job a = {.detail = d,
                              .residual = mem_calloc_large(texels, sizeof *a.residual),
                              .agreement = mem_calloc_large(texels, sizeof *a.agreement)};
    for (size_t i = 0; i < d->in.surface.inverse->valid_count; i++)
        a.residual[d->in.surface.inverse->valid[i]] = (float)scaled(d, d->in.surface.inverse->valid[i], RESIDUAL);
    for (int split = 0; split < SPLITS; split++) {
        sum_weighted(d, split, d->sum_scale);
        parallel_for(d->in.pool, chunks_of(d), agree_chunk, &a);
    }
    parallel_for(d->in.pool, chunks_of(d), share_chunk, &a);
    mem_free(a.agreement);
    mem_free(a.residual);
}

/* --- steps -------------------------------------------------------------------------------------- */

/* FISTA's extrapolated point. */
static rgb extrapolated(const struct detail *d, uint32_t texel) {
    rgb now = rgb_from_half(d->change[texel][0]), before = rgb_from_half(d->change[texel][1]);
    return rgb_mad(now, d->momentum, rgb_sub(now, before));
}

static void step_row(void *user, size_t row, int thread) {
    (void)thread;
    const struct picture_job *job = user;
    struct detail *d = job->detail;
    uint32_t width = photograph_of(d, job->train)->camera.width;
    struct footprint_texels t;
    use_row(d, job->train, row);
    for (uint32_t x = 0; x < width; x++) {
        size_t at = row * width + x;
        if (!pixel_footprint(d, job->train, x, (uint32_t)row, d->triangle[job->train][at], &t))
            continue;
        rgb residual = rgb_from_half(d->residual[job->train][at]);
        bool changes = false;
        for (size_t i = 0; i < t.count; i++) {
            changes |= d->signal_share[t.texel[i]] > 0.0f;
            residual = rgb_mad(residual, -t.share[i], extrapolated(d, t.texel[i]));
        }
        if (!changes) {
            d->triangle[job->train][at] = NONE;
            continue;
        }
        for (size_t i = 0; i < t.count; i++) {
            float scale = d->sum_scale * d->weight[job->train][at] * t.share[i];
            const float part[SUMS] = {residual.r * scale, residual.g * scale, residual.b * scale};
            for (int k = 0; k < SUMS; k++)
                add_to(&d->sum[t.texel[i]][k], part[k]);
        }
    }
}

/* Base colour stays at least 0, or at its start if that is less. */
static float bounded(float change, float start) { return fmaxf(change, fminf(-start, 0.0f)); }

static void step_texel(struct detail *d, uint32_t texel) {
    float scale = 1.0f / (d->sum_scale * d->weight_sum[texel]);
    const _Atomic int32_t *sum = d->sum[texel];
    rgb step = rgb_scale(rgb_make((float)sum[RED], (float)sum[GREEN], (float)sum[BLUE]), scale);
    rgb change = rgb_scale(rgb_add(extrapolated(d, texel), step), d->signal_share[texel]);
    rgb start = measured_value(&d->in.measured[texel]);
    memcpy(d->change[texel][1], d->change[texel][0], sizeof d->change[texel][0]);
    rgb_to_half(d->change[texel][0],
                rgb_make(bounded(change.r, start.r), bounded(change.g, start.g), bounded(change.b, start.b)));
}

static void step_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    struct detail *d = user;
    const struct inverse_uv *inverse = d->in.surface.inverse;
    for (size_t i = chunk * CHUNK; i < (chunk + 1) * CHUNK && i < inverse->valid_count; i++)
        if (d->signal_share[inverse->valid[i]] > 0.0f)
            step_texel(d, inverse->valid[i]);
}

void detail_step(struct detail *d) {
    clear_sums(d);
    for (uint32_t t = 0; t < d->in.views->train_count; t++)
        for_rows(d, t, step_row);
    parallel_for(d->in.pool, chunks_of(d), step_chunk, d);
    float before = d->t;
    d->t = 0.5f * (1.0f + sqrtf(1.0f + 4.0f * before * before));
    d->momentum = (before - 1.0f) / d->t;
}

void detail_finish(struct detail *d) {
    for (size_t i = 0; i < d->in.surface.inverse->valid_count; i++) {
        uint32_t texel = d->in.surface.inverse->valid[i];
        struct measured *m = &d->in.measured[texel];
        if (!(d->signal_share[texel] > 0.0f))
            continue;
        rgb_to_half(m->value, rgb_add(measured_value(m), rgb_from_half(d->change[texel][0])));
        rgb_to_half(m->noise, rgb_scale(rgb_from_half(m->noise), 1.0f - d->signal_share[texel]));
    }
}

/* --- the whole ---------------------------------------------------------------------------------- */

double detail_texels_per_pixel(const struct surface *s, const struct views *views) {
    double area = 0.0, count = 0.0;
    for (uint32_t t = 0; t < views->train_count; t++) {
        const struct camera *camera = &views->scene->photograph[views->train[t]].camera;
        for (uint32_t y = STRIDE / 2; y < camera->height; y += STRIDE) {
            for (uint32_t x = STRIDE / 2; x < camera->width; x += STRIDE) {
                struct footprint f;
                if (!footprint_find(&f, s->mesh, s->atlas, views->accel, camera, x, y))
                    continue;
                area += (double)fabsf(f.across.x * f.down.y - f.across.y * f.down.x);
                count += 1.0;
            }
        }
    }
    return count > 0.0 ? area / count : 0.0;
}

static void make_picture(struct detail *d, uint32_t train) {
    size_t pixels = pixels_of(d, train);
    struct picture_job job = {.detail = d, .train = train, .raw = mem_array(pixels, sizeof *job.raw)};
    d->triangle[train] = spill_take(spill_of(d), pixels, sizeof **d->triangle);
    d->weight[train] = spill_take(spill_of(d), pixels, sizeof **d->weight);
    d->residual[train] = spill_take(spill_of(d), pixels, sizeof **d->residual);
    parallel_for(d->in.pool, photograph_of(d, train)->camera.height, residual_row, &job);
    parallel_for(d->in.pool, photograph_of(d, train)->camera.height, filter_row, &job);
    mem_free(job.raw);
}

/* Drops pixels whose high-pass filter had too few neighbours, and scales the greatest weight to 1. */
static void choose_pixels(struct detail *d) {
    float most = 0.0f;
    for (uint32_t t = 0; t < d->in.views->train_count; t++) {
        for (size_t i = 0, width = photograph_of(d, t)->camera.width; i < pixels_of(d, t); i++) {
            if (i % width == 0)
                use_row(d, t, i / width);
            if (isnan(image_float_from_half(d->residual[t][i][0])))
                d->triangle[t][i] = NONE;
            most = d->triangle[t][i] == NONE ? most : fmaxf(most, d->weight[t][i]);
        }
    }
    for (uint32_t t = 0; t < d->in.views->train_count; t++) {
        for (size_t i = 0, width = photograph_of(d, t)->camera.width; i < pixels_of(d, t); i++) {
            if (i % width == 0)
                use_row(d, t, i / width);
            d->weight[t][i] = d->triangle[t][i] == NONE ? 0.0f : d->weight[t][i] / most;
        }
    }
}

/* Marks the texels that may change: measured ones with enough light. */
static void mark_known(struct detail *d, size_t texels) {
    const struct surface *s = &d->in.surface;
    d->chart_of_texel = mem_array(texels, sizeof *d->chart_of_texel);
    for (size_t i = 0; i < texels; i++) {
        bool known =
            s->inverse->triangle[i] != INVERSE_UV_NONE && d->in.measured[i].weight > 0.0f && d->in.lambert[i][0] != 0;
        d->chart_of_texel[i] = known ? surface_chart(s, (uint32_t)i) : NONE;
    }
}

enum status detail_reserve(const struct views *views, struct error *err) {
    const struct scene *scene = views->scene;
    uint64_t pixels = 0;
    for (uint32_t t = 0; t < views->train_count; t++) {
        const struct camera *camera = &scene->photograph[views->train[t]].camera;
        pixels += (uint64_t)camera->width * camera->height;
    }
    return spill_reserve(scene->spill, "the residuals of the photographs' pixels", 3 * views->train_count,
                         DETAIL_PIXEL_BYTES * pixels, 0, err);
}

void detail_init(struct detail *d, const struct detail_input *input) {
    const struct views *views = input->views;
    size_t texels = (size_t)input->surface.inverse->width * input->surface.inverse->height;
    *d = (struct detail){.in = *input, .t = 1.0f};
    d->triangle = mem_array(views->train_count, sizeof *d->triangle);
    d->weight = mem_array(views->train_count, sizeof *d->weight);
    d->residual = mem_array(views->train_count, sizeof *d->residual);
    d->sum = mem_calloc_large(texels, sizeof *d->sum);
    d->weight_sum = mem_calloc_large(texels, sizeof *d->weight_sum);
    d->signal_share = mem_calloc_large(texels, sizeof *d->signal_share);
    mark_known(d, texels);
    for (uint32_t t = 0; t < views->train_count; t++)
        make_picture(d, t);
    choose_pixels(d);
    sum_weights(d);
    find_shares(d, texels);
    d->change = mem_calloc_large(texels, sizeof *d->change);
}

void detail_release(struct detail *d) {
    for (uint32_t t = 0; t < d->in.views->train_count; t++) {
        spill_give(spill_of(d), d->triangle[t]);
        spill_give(spill_of(d), d->weight[t]);
        spill_give(spill_of(d), d->residual[t]);
    }
    mem_free(d->triangle);
    mem_free(d->weight);
    mem_free(d->residual);
    mem_free(d->chart_of_texel);
    mem_free(d->sum);
    mem_free(d->weight_sum);
    mem_free(d->signal_share);
    mem_free(d->change);
    *d = (struct detail){0};
}
