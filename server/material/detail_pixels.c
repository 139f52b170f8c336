/* detail_pixels.c -- see detail_pixels.h. */
#include "server/material/detail_pixels.h"

#include <math.h>

#include "common/mem.h"
#include "server/scene/rgb_half.h"

/* Least part of a pixel's footprint that must be known. */
#define MIN_KNOWN 0.75f /* +25 %: +0.04 dB */
/* Radius of the high-pass filter, pixels, and least number of pixels in its window. */
#define WINDOW 5         /* to 6: -0.01 dB */
#define MIN_WINDOW 12.0f /* +25 %: 0 dB */
/* Bound of one pixel's residual, base colour. */
#define MAX_RESIDUAL 0.2f /* +25 %: -0.02 dB */
/* Added to base colour where a pixel's noise is estimated from it: highlights are noisy, too. */
#define SPECULAR_FLOOR 0.1f /* +25 %: +0.01 dB */

static const struct photograph *photograph_of(const struct detail *d, uint32_t train) {
    return &d->in.views->scene->photograph[d->in.views->train[train]];
}

static size_t pixels_of(const struct detail *d, uint32_t train) {
    const struct camera *camera = &photograph_of(d, train)->camera;
    return (size_t)camera->width * camera->height;
}

/* Of the arrays with an element a pixel. */
static struct spill *spill_of(const struct detail *d) { return d->in.views->scene->spill; }

void detail_pixels_use(const struct detail *d, uint32_t train, size_t row) {
    size_t width = photograph_of(d, train)->camera.width, at = row * width;
    spill_use(spill_of(d), d->triangle[train] + at, width * sizeof **d->triangle);
    spill_use(spill_of(d), d->weight[train] + at, width * sizeof **d->weight);
    spill_use(spill_of(d), d->residual[train] + at, width * sizeof **d->residual);
}

void detail_pixels_rows(struct detail *d, uint32_t train, void (*body)(void *user, size_t row, int thread)) {
    const struct camera *camera = &photograph_of(d, train)->camera;
    struct detail_picture picture = {.detail = d, .train = train, .width = camera->width};
    parallel_for(d->in.pool, camera->height, body, &picture);
}

bool detail_pixels_footprint(const struct detail *d, uint32_t train, uint32_t x, uint32_t y, uint32_t triangle,
                             struct footprint_texels *t) {
    const struct surface *s = &d->in.surface;
    struct footprint f;
    return triangle != DETAIL_NONE &&
           footprint_of_triangle(&f, s->mesh, s->atlas, &photograph_of(d, train)->camera, x, y, triangle) &&
           footprint_texels(t, &f, s->atlas->chart_of_triangle[triangle], d->chart_of_texel, s->inverse->width,
                            s->inverse->height) >= MIN_KNOWN;
}

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
        return DETAIL_NONE;
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
    const struct detail_picture *job = user;
    struct detail *d = job->detail;
    const struct photograph *photo = photograph_of(d, job->train);
    struct footprint_texels t;
    detail_pixels_use(d, job->train, row);
    views_use(d->in.views, job->train, row * photo->camera.width, photo->camera.width);
    for (uint32_t x = 0; x < photo->camera.width; x++) {
        size_t at = row * photo->camera.width + x;
        rgb observed = rgb_gray(0.0f), predicted = observed, lambert = observed;
        uint32_t triangle = pixel_triangle(d, job->train, x, (uint32_t)row, &observed);
        d->triangle[job->train][at] = DETAIL_NONE;
        if (!detail_pixels_footprint(d, job->train, x, (uint32_t)row, triangle, &t))
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
    const struct detail_picture *job = user;
    const struct camera *camera = &photograph_of(job->detail, job->train)->camera;
    const uint8_t *owner = job->detail->in.views->owner[job->train];
    const uint32_t *triangle = job->detail->triangle[job->train];
    long width = (long)camera->width, height = (long)camera->height, y0 = (long)row;
    for (long y = y0 > WINDOW ? y0 - WINDOW : 0; y <= y0 + WINDOW && y < height; y++) {
        detail_pixels_use(job->detail, job->train, (size_t)y);
        views_use(job->detail->in.views, job->train, (size_t)(y * width), (size_t)width);
    }
    for (long x0 = 0; x0 < width; x0++) {
        size_t at = (size_t)(y0 * width + x0);
        rgb sum = rgb_gray(0.0f), residual = rgb_gray(NAN);
        float count = 0.0f;
        for (long y = y0 > WINDOW ? y0 - WINDOW : 0; triangle[at] != DETAIL_NONE && y <= y0 + WINDOW && y < height;
             y++) {
            for (long x = x0 > WINDOW ? x0 - WINDOW : 0; x <= x0 + WINDOW && x < width; x++) {
                size_t near = (size_t)(y * width + x);
                if (triangle[near] == DETAIL_NONE || owner[near] != owner[at])
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

static void make_picture(struct detail *d, uint32_t train) {
    const struct camera *camera = &photograph_of(d, train)->camera;
    size_t pixels = pixels_of(d, train);
    struct detail_picture job = {
        .detail = d, .train = train, .width = camera->width, .raw = mem_array(pixels, sizeof *job.raw)};
    d->triangle[train] = spill_take(spill_of(d), pixels, sizeof **d->triangle);
    d->weight[train] = spill_take(spill_of(d), pixels, sizeof **d->weight);
    d->residual[train] = spill_take(spill_of(d), pixels, sizeof **d->residual);
    parallel_for(d->in.pool, camera->height, residual_row, &job);
    parallel_for(d->in.pool, camera->height, filter_row, &job);
    mem_free(job.raw);
}

/* Drops pixels whose high-pass filter had too few neighbours, and scales the greatest weight to 1. */
static void choose_pixels(struct detail *d) {
    float most = 0.0f;
    for (uint32_t t = 0; t < d->in.views->train_count; t++) {
        for (size_t i = 0, width = photograph_of(d, t)->camera.width; i < pixels_of(d, t); i++) {
            if (i % width == 0)
                detail_pixels_use(d, t, i / width);
            if (isnan(image_float_from_half(d->residual[t][i][0])))
                d->triangle[t][i] = DETAIL_NONE;
            most = d->triangle[t][i] == DETAIL_NONE ? most : fmaxf(most, d->weight[t][i]);
        }
    }
    d->variance = most > 0.0f ? SPECULAR_FLOOR * SPECULAR_FLOOR / most : 0.0f; /* weight_of */
    for (uint32_t t = 0; t < d->in.views->train_count; t++) {
        for (size_t i = 0, width = photograph_of(d, t)->camera.width; i < pixels_of(d, t); i++) {
            if (i % width == 0)
                detail_pixels_use(d, t, i / width);
            d->weight[t][i] = d->triangle[t][i] == DETAIL_NONE ? 0.0f : d->weight[t][i] / most;
        }
    }
}

void detail_pixels_make(struct detail *d) {
    uint32_t count = (uint32_t)d->in.views->train_count;
    d->triangle = mem_array(count, sizeof *d->triangle);
    d->weight = mem_array(count, sizeof *d->weight);
    d->residual = mem_array(count, sizeof *d->residual);
    for (uint32_t t = 0; t < count; t++)
        make_picture(d, t);
    choose_pixels(d);
}

void detail_pixels_release(struct detail *d) {
    for (uint32_t t = 0; t < d->in.views->train_count; t++) {
        spill_give(spill_of(d), d->triangle[t]);
        spill_give(spill_of(d), d->weight[t]);
        spill_give(spill_of(d), d->residual[t]);
    }
    mem_free(d->triangle);
    mem_free(d->weight);
    mem_free(d->residual);
}
