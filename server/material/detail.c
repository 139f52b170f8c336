/* detail.c -- see detail.h. */
#include "server/material/detail.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/material/detail_agreement.h"
#include "server/material/detail_pixels.h"
#include "server/scene/rgb_half.h"

#define STRIDE 16 /* pixels between those of which the footprint's size is taken; +25 %: no change */

enum { RED, GREEN, BLUE, SUMS }; /* the sums in use while steps are made */

/* --- steps -------------------------------------------------------------------------------------- */

/* FISTA's extrapolated point. */
static rgb extrapolated(const struct detail *d, uint32_t texel) {
    rgb now = rgb_from_half(d->change[texel][0]), before = rgb_from_half(d->change[texel][1]);
    return rgb_mad(now, d->momentum, rgb_sub(now, before));
}

static void step_row(void *user, size_t row, int thread) {
    (void)thread;
    const struct detail_picture *job = user;
    struct detail *d = job->detail;
    uint32_t width = job->width;
    struct footprint_texels t;
    detail_pixels_use(d, job->train, row);
    for (uint32_t x = 0; x < width; x++) {
        size_t at = row * width + x;
        if (!detail_pixels_footprint(d, job->train, x, (uint32_t)row, d->triangle[job->train][at], &t))
            continue;
        rgb residual = rgb_from_half(d->residual[job->train][at]);
        bool changes = false;
        for (size_t i = 0; i < t.count; i++) {
            changes |= d->signal_share[t.texel[i]] > 0.0f;
            residual = rgb_mad(residual, -t.share[i], extrapolated(d, t.texel[i]));
        }
        if (!changes) {
            d->triangle[job->train][at] = DETAIL_NONE;
            continue;
        }
        for (size_t i = 0; i < t.count; i++) {
            float scale = d->sum_scale * d->weight[job->train][at] * t.share[i];
            const float part[SUMS] = {residual.r * scale, residual.g * scale, residual.b * scale};
            for (int k = 0; k < SUMS; k++)
                detail_add(&d->sum[t.texel[i]][k], part[k]);
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
    rgb start = measurement_value(&d->in.measured[texel]);
    memcpy(d->change[texel][1], d->change[texel][0], sizeof d->change[texel][0]);
    rgb_to_half(d->change[texel][0],
                rgb_make(bounded(change.r, start.r), bounded(change.g, start.g), bounded(change.b, start.b)));
}

static void step_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    struct detail *d = user;
    const struct inverse_uv *inverse = d->in.surface.inverse;
    for (size_t i = chunk * DETAIL_CHUNK; i < (chunk + 1) * DETAIL_CHUNK && i < inverse->valid_count; i++)
        if (d->signal_share[inverse->valid[i]] > 0.0f)
            step_texel(d, inverse->valid[i]);
}

void detail_step(struct detail *d) {
    detail_clear_sums(d);
    for (uint32_t t = 0; t < d->in.views->train_count; t++)
        detail_pixels_rows(d, t, step_row);
    parallel_for(d->in.pool, detail_chunks(d), step_chunk, d);
    float before = d->t;
    d->t = 0.5f * (1.0f + sqrtf(1.0f + 4.0f * before * before));
    d->momentum = (before - 1.0f) / d->t;
}

void detail_finish(struct detail *d) {
    for (size_t i = 0; i < d->in.surface.inverse->valid_count; i++) {
        uint32_t texel = d->in.surface.inverse->valid[i];
        struct measurement *m = &d->in.measured[texel];
        if (!(d->signal_share[texel] > 0.0f))
            continue;
        rgb_to_half(m->value, rgb_add(measurement_value(m), rgb_from_half(d->change[texel][0])));
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

/* Marks the texels that may change: measured ones with enough light. */
static void mark_known(struct detail *d, size_t texels) {
    const struct surface *s = &d->in.surface;
    d->chart_of_texel = mem_array(texels, sizeof *d->chart_of_texel);
    for (size_t i = 0; i < texels; i++) {
        bool known =
            s->inverse->triangle[i] != INVERSE_UV_NONE && d->in.measured[i].weight > 0.0f && d->in.lambert[i][0] != 0;
        d->chart_of_texel[i] = known ? surface_chart(s, (uint32_t)i) : DETAIL_NONE;
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
    size_t texels = (size_t)input->surface.inverse->width * input->surface.inverse->height;
    *d = (struct detail){.in = *input, .t = 1.0f};
    d->sum = mem_calloc_large(texels, sizeof *d->sum);
    d->weight_sum = mem_calloc_large(texels, sizeof *d->weight_sum);
    d->signal_share = mem_calloc_large(texels, sizeof *d->signal_share);
    mark_known(d, texels);
    detail_pixels_make(d);
    detail_agreement_find(d);
    d->change = mem_calloc_large(texels, sizeof *d->change);
}

void detail_release(struct detail *d) {
    detail_pixels_release(d);
    mem_free(d->chart_of_texel);
    mem_free(d->sum);
    mem_free(d->weight_sum);
    mem_free(d->signal_share);
    mem_free(d->change);
    *d = (struct detail){0};
}
