/* detail.c -- see detail.h.
 *
 * Photographs are gone through pixel by pixel, on all threads; what each tells of the texels beneath it is added to sums
 * of whole numbers, which come out the same in any order. */
#include "server/material/detail.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/capture/halves.h"
#include "server/material/footprint.h"
#include "server/scene/rgb_half.h"

#define CHUNK 4096 /* texels a work item */
#define STRIDE 16  /* pixels, when it is asked how large they are */
#define NONE UINT32_MAX
/* A pixel is asked only where most of what it covers is known. */
#define KNOWN_LEAST 0.75f
/* What differs over more than this many pixels to either side is not texture; told from at least so many of them. */
#define WINDOW 5
#define WINDOW_LEAST 12.0f
/* Of base colour, by one pixel. */
#define OFF_MOST 0.2f
/* Noise of a pixel, as a share of what it shows, is told from base colour and so much more: highlights are noisy, too. */
#define SHEEN 0.1f
/* Ways in which photographs are parted in halves; in those that count the lesser has this part of a texel's weight. */
#define WAYS 4
#define HALF_LEAST 0.15f
/* Texels to either side over which it is averaged how far the halves agree, and what disagreement counts: it is in part
 * that one half is sharper than the other. */
#define AROUND 4
#define DISAGREEMENT 0.04f
#define SHARE_LEAST 0.05f /* texels of which the photographs tell less stay as they are */
/* Of whole numbers in sums: coarse, until the most pixels of a texel are known; then so that these have room. The
 * worth of pixels differs by orders of magnitude: counted coarsely the least would be lost, and steps be too long. */
#define COUNT_SCALE 4096.0f
#define SUM_MOST 1e9f

enum { RED, GREEN, BLUE, SUMS };
enum { COUNT, OFF };            /* sums of another kind: pixels, and what they are off by */
#define ALL_PHOTOGRAPHS (-1)    /* in place of a way to part them */

/* One photograph that is gone through. */
struct picture_job {
    struct detail *detail;
    uint32_t train;
    rgb *raw; /* [pixels] what is off before the mean is taken away */
};

static const struct photograph *photograph_of(const struct detail *d, uint32_t train) {
    return &d->r->scene->photograph[d->views->train[train]];
}

static size_t pixels_of(const struct detail *d, uint32_t train) {
    const struct camera *camera = &photograph_of(d, train)->camera;
    return (size_t)camera->width * camera->height;
}

/* Calls body for each row of a photograph. */
static void for_rows(struct detail *d, uint32_t train, void (*body)(void *user, size_t row, int thread)) {
    struct picture_job job = {.detail = d, .train = train};
    parallel_for(d->r->pool, photograph_of(d, train)->camera.height, body, &job);
}

static size_t chunks_of(const struct detail *d) { return (d->r->inverse.valid_count + CHUNK - 1) / CHUNK; }

/* The texels beneath a pixel that shows a triangle; false where too few of them are known. */
static bool texels_beneath(const struct detail *d, uint32_t train, uint32_t x, uint32_t y, uint32_t triangle,
                           struct footprint_texels *t) {
    const struct reconstruction *r = d->r;
    struct footprint f;
    return triangle != NONE &&
           footprint_of_triangle(&f, &r->scene->mesh, &r->atlas, &photograph_of(d, train)->camera, x, y, triangle) &&
           footprint_texels(t, &f, r->atlas.chart_of_triangle[triangle], d->chart_of_texel, r->inverse.width,
                            r->inverse.height) >= KNOWN_LEAST;
}

static void add_to(_Atomic int32_t *sum, float what) {
    atomic_fetch_add_explicit(sum, (int32_t)lrintf(what), memory_order_relaxed);
}

/* --- what pixels should show -------------------------------------------------------------------- */

static rgb divided(rgb over, rgb under) {
    return rgb_make(over.r / under.r, over.g / under.g, over.b / under.b);
}

/* The triangle that a pixel shows; NONE where that is an emitter, or not all that it shows, or more than it can tell. */
static uint32_t triangle_shown(const struct detail *d, uint32_t train, uint32_t x, uint32_t y, rgb *shown) {
    const struct photograph *photo = photograph_of(d, train);
    const struct reconstruction *r = d->r;
    struct photograph_sample s;
    struct footprint f;
    float cx = (float)x + 0.5f, cy = (float)y + 0.5f;
    if (d->views->edge[train][(size_t)y * photo->camera.width + x] > 0 || photograph_has_firefly(photo, cx, cy) ||
        !photograph_sample(photo, cx, cy, &s) || s.saturated[0] || s.saturated[1] || s.saturated[2] ||
        !footprint_find(&f, &r->scene->mesh, &r->atlas, d->views->accel, &photo->camera, x, y) ||
        r->is_emitter[r->segments.of_triangle[f.triangle]])
        return NONE;
    *shown = s.radiance;
    return f.triangle;
}

/* What of a pixel's noise is that of its brightness: as a share of white its variance is that of a share of what it
 * shows. */
static float worth_of(const struct detail *d, const struct photograph *photo, rgb told, rgb white) {
    rgb bright = rgb_mad(rgb_clamp(told, 0.0f, INFINITY), SHEEN, white);
    float dark = SHEEN * rgb_mean(white) / rgb_mean(bright);
    return noise_weight_of_brightness(&d->r->noise, photo, bright) * dark * dark;
}

/* What each pixel shows beyond what the texture tells, as base colour. A single pixel that is far too bright, as a
 * renderer's samples may leave it, would darken all around it when the mean is taken away. */
static void find_row(void *user, size_t row, int thread) {
    (void)thread;
    const struct picture_job *job = user;
    struct detail *d = job->detail;
    const struct photograph *photo = photograph_of(d, job->train);
    struct footprint_texels t;
    for (uint32_t x = 0; x < photo->camera.width; x++) {
        size_t at = row * photo->camera.width + x;
        rgb shown = rgb_gray(0.0f), told = shown, white = shown;
        uint32_t triangle = triangle_shown(d, job->train, x, (uint32_t)row, &shown);
        d->triangle[job->train][at] = NONE;
        if (!texels_beneath(d, job->train, x, (uint32_t)row, triangle, &t))
            continue;
        for (size_t i = 0; i < t.count; i++) {
            rgb part = rgb_scale(rgb_from_half(d->white[t.texel[i]]), t.share[i]);
            white = rgb_add(white, part);
            told = rgb_add(told, rgb_mul(part, rgb_from_half(d->measured[t.texel[i]].value)));
        }
        d->triangle[job->train][at] = triangle;
        d->worth[job->train][at] = worth_of(d, photo, told, white);
        job->raw[at] = rgb_clamp(divided(rgb_sub(shown, told), white), -OFF_MOST, OFF_MOST);
    }
}

/* Takes away the mean of the same segment's pixels around each. */
static void flatten_row(void *user, size_t row, int thread) {
    (void)thread;
    const struct picture_job *job = user;
    const struct camera *camera = &photograph_of(job->detail, job->train)->camera;
    const uint8_t *owner = job->detail->views->owner[job->train];
    const uint32_t *triangle = job->detail->triangle[job->train];
    long width = (long)camera->width, height = (long)camera->height, y0 = (long)row;
    for (long x0 = 0; x0 < width; x0++) {
        size_t at = (size_t)(y0 * width + x0);
        rgb sum = rgb_gray(0.0f), off = rgb_gray(NAN);
        float count = 0.0f;
        for (long y = y0 > WINDOW ? y0 - WINDOW : 0; triangle[at] != NONE && y <= y0 + WINDOW && y < height; y++) {
            for (long x = x0 > WINDOW ? x0 - WINDOW : 0; x <= x0 + WINDOW && x < width; x++) {
                size_t beside = (size_t)(y * width + x);
                if (triangle[beside] == NONE || owner[beside] != owner[at])
                    continue;
                sum = rgb_add(sum, job->raw[beside]);
                count += 1.0f;
            }
        }
        if (count >= WINDOW_LEAST)
            off = rgb_mad(job->raw[at], -1.0f / count, sum);
        rgb_to_half(job->detail->off[job->train][at], off);
    }
}

/* --- how far photographs agree ------------------------------------------------------------------ */

static void clear_sums(struct detail *d) {
    for (size_t i = 0; i < d->r->inverse.valid_count; i++)
        for (int k = 0; k < SUMS; k++)
            d->sum[d->r->inverse.valid[i]][k] = 0;
}

/* Adds to the texels beneath each pixel its worth, and what it is off by, times that. */
static void weigh_row(void *user, size_t row, int thread) {
    (void)thread;
    const struct picture_job *job = user;
    struct detail *d = job->detail;
    uint32_t width = photograph_of(d, job->train)->camera.width, train = job->train;
    struct footprint_texels t;
    for (uint32_t x = 0; x < width; x++) {
        size_t at = row * width + x;
        if (!texels_beneath(d, train, x, (uint32_t)row, d->triangle[train][at], &t))
            continue;
        float off = rgb_mean(rgb_from_half(d->off[train][at])), worth = d->sum_scale * d->worth[train][at];
        for (size_t i = 0; i < t.count; i++) {
            add_to(&d->sum[t.texel[i]][COUNT], worth * t.share[i]);
            add_to(&d->sum[t.texel[i]][OFF], worth * t.share[i] * off);
        }
    }
}

/* Sums over all photographs, or those of the first half of a way to part them. */
static void weigh(struct detail *d, int way, float scale) {
    clear_sums(d);
    d->sum_scale = scale;
    for (uint32_t t = 0; t < d->views->train_count; t++)
        if (way == ALL_PHOTOGRAPHS || halves_of(t, way) == 0)
            for_rows(d, t, weigh_row);
}

/* What the halves tell of a texel, over the ways to part them: squares of the mean of what it is off by, and what both
 * have in common of it. */
struct agreement {
    float square, common;
};

struct agreeing {
    struct detail *detail;
    float *off;                  /* [height][width] the sum over all photographs */
    struct agreement *agreement; /* [height][width] */
};

static double scaled(const struct detail *d, size_t texel, int sum) {
    return (double)d->sum[texel][sum] / (double)d->sum_scale;
}

/* Adds what the halves of one way tell; nothing where one tells next to nothing. */
static void agree_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct agreeing *a = user;
    const struct detail *d = a->detail;
    const struct inverse_uv *inverse = &d->r->inverse;
    for (size_t i = chunk * CHUNK; i < (chunk + 1) * CHUNK && i < inverse->valid_count; i++) {
        uint32_t texel = inverse->valid[i];
        double all = (double)d->count[texel], count[2] = {scaled(d, texel, COUNT)}, off[2] = {scaled(d, texel, OFF)};
        count[1] = all - count[0];
        off[1] = (double)a->off[texel] - off[0];
        if (!(all > 0.0) || fmin(count[0], count[1]) < HALF_LEAST * all)
            continue;
        double mean = (double)a->off[texel] / all;
        a->agreement[texel].square += (float)(mean * mean);
        a->agreement[texel].common += (float)(off[0] / count[0] * (off[1] / count[1]));
    }
}

/* Of what a texel is off by, the share that is not noise. */
static float share_told(const struct agreeing *a, uint32_t texel) {
    const struct detail *d = a->detail;
    long width = (long)d->r->inverse.width, height = (long)d->r->inverse.height;
    long x0 = (long)texel % width, y0 = (long)texel / width;
    double square = 0.0, common = 0.0;
    if (!(a->agreement[texel].square > 0.0f))
        return 0.0f;
    for (long y = y0 - AROUND; y <= y0 + AROUND; y++) {
        for (long x = x0 - AROUND; x <= x0 + AROUND; x++) {
            size_t at = (size_t)(y * width + x);
            if (x < 0 || y < 0 || x >= width || y >= height || d->chart_of_texel[at] != d->chart_of_texel[texel])
                continue;
            square += (double)a->agreement[at].square;
            common += (double)a->agreement[at].common;
        }
    }
    double noise = DISAGREEMENT * fmax(square - common, 0.0);
    float share = common > 0.0 ? (float)(common / (common + noise)) : 0.0f;
    return share < SHARE_LEAST ? 0.0f : share;
}

static void share_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct agreeing *a = user;
    struct detail *d = a->detail;
    const struct inverse_uv *inverse = &d->r->inverse;
    for (size_t i = chunk * CHUNK; i < (chunk + 1) * CHUNK && i < inverse->valid_count; i++)
        if (d->chart_of_texel[inverse->valid[i]] != NONE)
            d->told[inverse->valid[i]] = share_told(a, inverse->valid[i]);
}

/* Counts the pixels of each texel, and chooses the scale of sums for the most of one. */
static void count_pixels(struct detail *d) {
    float most = 0.0f;
    weigh(d, ALL_PHOTOGRAPHS, COUNT_SCALE);
    for (size_t i = 0; i < d->r->inverse.valid_count; i++)
        most = fmaxf(most, (float)scaled(d, d->r->inverse.valid[i], COUNT));
    weigh(d, ALL_PHOTOGRAPHS, SUM_MOST / fmaxf(most, 1.0f));
    for (size_t i = 0; i < d->r->inverse.valid_count; i++)
        d->count[d->r->inverse.valid[i]] = (float)scaled(d, d->r->inverse.valid[i], COUNT);
}

/* Finds what share of what each texel is off by the photographs agree on. The sums are those of all photographs, as
 * count_pixels leaves them. */
static void find_shares(struct detail *d, size_t texels) {
    struct agreeing a = {d, mem_calloc_large(texels, sizeof *a.off), mem_calloc_large(texels, sizeof *a.agreement)};
    for (size_t i = 0; i < d->r->inverse.valid_count; i++)
        a.off[d->r->inverse.valid[i]] = (float)scaled(d, d->r->inverse.valid[i], OFF);
    for (int way = 0; way < WAYS; way++) {
        weigh(d, way, d->sum_scale);
        parallel_for(d->r->pool, chunks_of(d), agree_chunk, &a);
    }
    parallel_for(d->r->pool, chunks_of(d), share_chunk, &a);
    mem_free(a.agreement);
    mem_free(a.off);
}

/* --- steps -------------------------------------------------------------------------------------- */

/* By how much a texel's base colour is taken to be off: as it was moved, and further the same way. */
static rgb reached(const struct detail *d, uint32_t texel) {
    rgb now = rgb_from_half(d->moved[texel][0]), before = rgb_from_half(d->moved[texel][1]);
    return rgb_mad(now, d->onward, rgb_sub(now, before));
}

static void step_row(void *user, size_t row, int thread) {
    (void)thread;
    const struct picture_job *job = user;
    struct detail *d = job->detail;
    uint32_t width = photograph_of(d, job->train)->camera.width;
    struct footprint_texels t;
    for (uint32_t x = 0; x < width; x++) {
        size_t at = row * width + x;
        if (!texels_beneath(d, job->train, x, (uint32_t)row, d->triangle[job->train][at], &t))
            continue;
        rgb off = rgb_from_half(d->off[job->train][at]);
        bool moves = false;
        for (size_t i = 0; i < t.count; i++) {
            moves |= d->told[t.texel[i]] > 0.0f;
            off = rgb_mad(off, -t.share[i], reached(d, t.texel[i]));
        }
        if (!moves) {
            d->triangle[job->train][at] = NONE;
            continue;
        }
        for (size_t i = 0; i < t.count; i++) {
            float scale = d->sum_scale * d->worth[job->train][at] * t.share[i];
            const float part[SUMS] = {off.r * scale, off.g * scale, off.b * scale};
            for (int k = 0; k < SUMS; k++)
                add_to(&d->sum[t.texel[i]][k], part[k]);
        }
    }
}

/* No darker than black, unless it was. */
static float bounded(float moved, float start) {
    return fmaxf(moved, fminf(-start, 0.0f));
}

static void move_texel(struct detail *d, uint32_t texel) {
    float scale = 1.0f / (d->sum_scale * d->count[texel]);
    const _Atomic int32_t *sum = d->sum[texel];
    rgb by = rgb_scale(rgb_make((float)sum[RED], (float)sum[GREEN], (float)sum[BLUE]), scale);
    rgb moved = rgb_scale(rgb_add(reached(d, texel), by), d->told[texel]);
    rgb start = measured_value(&d->measured[texel]);
    memcpy(d->moved[texel][1], d->moved[texel][0], sizeof d->moved[texel][0]);
    rgb_to_half(d->moved[texel][0], rgb_make(bounded(moved.r, start.r), bounded(moved.g, start.g),
                                             bounded(moved.b, start.b)));
}

static void move_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    struct detail *d = user;
    const struct inverse_uv *inverse = &d->r->inverse;
    for (size_t i = chunk * CHUNK; i < (chunk + 1) * CHUNK && i < inverse->valid_count; i++)
        if (d->told[inverse->valid[i]] > 0.0f)
            move_texel(d, inverse->valid[i]);
}

void detail_step(struct detail *d) {
    clear_sums(d);
    for (uint32_t t = 0; t < d->views->train_count; t++)
        for_rows(d, t, step_row);
    parallel_for(d->r->pool, chunks_of(d), move_chunk, d);
    float before = d->pace;
    d->pace = 0.5f * (1.0f + sqrtf(1.0f + 4.0f * before * before));
    d->onward = (before - 1.0f) / d->pace;
}

void detail_finish(struct detail *d) {
    for (size_t i = 0; i < d->r->inverse.valid_count; i++) {
        uint32_t texel = d->r->inverse.valid[i];
        struct measured *m = &d->measured[texel];
        if (!(d->told[texel] > 0.0f))
            continue;
        rgb_to_half(m->value, rgb_add(measured_value(m), rgb_from_half(d->moved[texel][0])));
        rgb_to_half(m->noise, rgb_scale(rgb_from_half(m->noise), 1.0f - d->told[texel]));
    }
}

/* --- the whole ---------------------------------------------------------------------------------- */

double detail_texels_a_pixel(const struct reconstruction *r, const struct views *views) {
    double area = 0.0, count = 0.0;
    for (uint32_t t = 0; t < views->train_count; t++) {
        const struct camera *camera = &r->scene->photograph[views->train[t]].camera;
        for (uint32_t y = STRIDE / 2; y < camera->height; y += STRIDE) {
            for (uint32_t x = STRIDE / 2; x < camera->width; x += STRIDE) {
                struct footprint f;
                if (!footprint_find(&f, &r->scene->mesh, &r->atlas, views->accel, camera, x, y))
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
    d->triangle[train] = mem_array(pixels, sizeof **d->triangle);
    d->worth[train] = mem_array(pixels, sizeof **d->worth);
    d->off[train] = mem_array(pixels, sizeof **d->off);
    parallel_for(d->r->pool, photograph_of(d, train)->camera.height, find_row, &job);
    parallel_for(d->r->pool, photograph_of(d, train)->camera.height, flatten_row, &job);
    mem_free(job.raw);
}

/* Forgets the pixels that too few others are around of, and makes the most that one is worth 1. */
static void choose_pixels(struct detail *d) {
    float most = 0.0f;
    for (uint32_t t = 0; t < d->views->train_count; t++) {
        for (size_t i = 0; i < pixels_of(d, t); i++) {
            if (isnan(image_float_from_half(d->off[t][i][0])))
                d->triangle[t][i] = NONE;
            most = d->triangle[t][i] == NONE ? most : fmaxf(most, d->worth[t][i]);
        }
    }
    for (uint32_t t = 0; t < d->views->train_count; t++)
        for (size_t i = 0; i < pixels_of(d, t); i++)
            d->worth[t][i] = d->triangle[t][i] == NONE ? 0.0f : d->worth[t][i] / most;
}

/* The texels that may be moved: those that were measured, where there is light to tell them by. */
static void mark_known(struct detail *d, size_t texels) {
    const struct reconstruction *r = d->r;
    d->chart_of_texel = mem_array(texels, sizeof *d->chart_of_texel);
    for (size_t i = 0; i < texels; i++) {
        bool known = r->inverse.triangle[i] != INVERSE_UV_NONE && d->measured[i].weight > 0.0f && d->white[i][0] != 0;
        d->chart_of_texel[i] = known ? r->atlas.chart_of_triangle[r->inverse.triangle[i]] : NONE;
    }
}

void detail_init(struct detail *d, const struct reconstruction *r, const struct views *views,
                 const uint16_t (*white)[3], struct measured *measured) {
    size_t texels = (size_t)r->inverse.width * r->inverse.height;
    *d = (struct detail){.r = r, .views = views, .white = white, .measured = measured, .pace = 1.0f};
    d->triangle = mem_array(views->train_count, sizeof *d->triangle);
    d->worth = mem_array(views->train_count, sizeof *d->worth);
    d->off = mem_array(views->train_count, sizeof *d->off);
    d->sum = mem_calloc_large(texels, sizeof *d->sum);
    d->count = mem_calloc_large(texels, sizeof *d->count);
    d->told = mem_calloc_large(texels, sizeof *d->told);
    mark_known(d, texels);
    for (uint32_t t = 0; t < views->train_count; t++)
        make_picture(d, t);
    choose_pixels(d);
    count_pixels(d);
    find_shares(d, texels);
    d->moved = mem_calloc_large(texels, sizeof *d->moved);
}

void detail_release(struct detail *d) {
    for (uint32_t t = 0; t < d->views->train_count; t++) {
        mem_free(d->triangle[t]);
        mem_free(d->worth[t]);
        mem_free(d->off[t]);
    }
    mem_free(d->triangle);
    mem_free(d->worth);
    mem_free(d->off);
    mem_free(d->chart_of_texel);
    mem_free(d->sum);
    mem_free(d->count);
    mem_free(d->told);
    mem_free(d->moved);
    *d = (struct detail){0};
}
