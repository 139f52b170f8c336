/* detail.c -- see detail.h. */
#include "server/reconstruct/detail.h"

#include <math.h>

#include "common/mem.h"
#include "server/capture/halves.h"
#include "server/reconstruct/footprint.h"
#include "server/scene/rgb_half.h"
#include "server/scene/surface.h"

#define SIDE 3     /* places a row and column of a footprint at which the texture is read */
#define CHUNK 4096 /* texels a work item */
#define STRIDE 16  /* pixels, when it is asked how large they are */
/* A pixel is asked only where most of what it covers is known. */
#define KNOWN_LEAST 0.75f
#define TAP_LEAST 0.05f /* weight of the known ones among the four texels of a look-up */
/* What differs over more than this many pixels to either side is not texture; told from at least so many of them. */
#define WINDOW 5
#define WINDOW_LEAST 12.0f
/* The lesser half of the photographs of a texel must have this part of the weight. */
#define HALF_LEAST 0.15f
/* Of base colour, at once: by one pixel, and of one texel. */
#define OFF_MOST 0.2f
#define STEP_MOST 0.2f
#define BASE_MOST 1.2f
/* Base colour by which looks are weighed, as in divide.c. */
#define TYPICAL_BASE_COLOR 0.5f

enum { VALUE, NOISE, KINDS };

/* What is told of a value, and of the noise in it. */
struct both {
    rgb of[KINDS];
};

/* One photograph of a step. */
struct picture_job {
    struct detail *detail;
    uint32_t train;
    struct both *raw; /* [pixels] NAN where a pixel is not asked */
};

static float *channels_of(rgb *value) {
    return &value->r;
}

static const struct photograph *photograph_of(const struct detail *d, uint32_t train) {
    return &d->r->scene->photograph[d->views->train[train]];
}

/* --- what pixels should show -------------------------------------------------------------------- */

static bool is_known(const struct detail *d, size_t texel) {
    return d->measured[texel].weight > 0.0f && d->white[texel][0] != 0;
}

static void add(struct both *sum, float weight, const struct both *one) {
    for (int kind = 0; kind < KINDS; kind++)
        sum->of[kind] = rgb_mad(sum->of[kind], weight, one->of[kind]);
}

/* What the texel (x, y) of a chart sends out; false where that is not known. */
static bool texel_sends(const struct detail *d, long x, long y, uint32_t chart, struct both *radiance) {
    const struct inverse_uv *inverse = &d->r->inverse;
    if (x < 0 || y < 0 || x >= (long)inverse->width || y >= (long)inverse->height)
        return false;
    size_t texel = (size_t)y * inverse->width + (size_t)x;
    uint32_t triangle = inverse->triangle[texel];
    if (triangle == INVERSE_UV_NONE || d->r->atlas.chart_of_triangle[triangle] != chart || !is_known(d, texel))
        return false;
    rgb white = rgb_from_half(d->white[texel]);
    radiance->of[VALUE] = rgb_mul(rgb_from_half(d->measured[texel].value), white);
    radiance->of[NOISE] = rgb_mul(rgb_from_half(d->measured[texel].noise), white);
    return true;
}

/* Adds a bilinear look-up at a place of the atlas, of the texels that are known; false where there are none. */
static bool add_place(struct both *sum, const struct detail *d, vec2 at, uint32_t chart) {
    float fx = at.x - 0.5f, fy = at.y - 0.5f, weights = 0.0f;
    long x = (long)floorf(fx), y = (long)floorf(fy);
    float tx = fx - (float)x, ty = fy - (float)y;
    struct both here = {{{0.0f, 0.0f, 0.0f}}}, tap;
    for (int k = 0; k < 4; k++) {
        float weight = (k & 1 ? tx : 1.0f - tx) * (k & 2 ? ty : 1.0f - ty);
        if (texel_sends(d, x + (k & 1), y + (k >> 1), chart, &tap)) {
            add(&here, weight, &tap);
            weights += weight;
        }
    }
    if (weights < TAP_LEAST)
        return false;
    add(sum, 1.0f / weights, &here);
    return true;
}

/* The mean over a footprint. */
static bool footprint_sends(const struct detail *d, const struct footprint *f, struct both *radiance) {
    uint32_t chart = d->r->atlas.chart_of_triangle[f->triangle];
    struct both sum = {{{0.0f, 0.0f, 0.0f}}};
    float count = 0.0f;
    for (int k = 0; k < SIDE * SIDE; k++) {
        float a = ((float)(k % SIDE) + 0.5f) / SIDE - 0.5f, b = ((float)(k / SIDE) + 0.5f) / SIDE - 0.5f;
        vec2 at = {f->middle.x + a * f->across.x + b * f->down.x, f->middle.y + a * f->across.y + b * f->down.y};
        count += add_place(&sum, d, at, chart) ? 1.0f : 0.0f;
    }
    *radiance = (struct both){{rgb_scale(sum.of[VALUE], 1.0f / count), rgb_scale(sum.of[NOISE], 1.0f / count)}};
    return count >= KNOWN_LEAST * SIDE * SIDE;
}

/* Bounds each channel by a part of what is white: a single pixel that is far too bright, as a renderer's samples may
 * leave it, would darken all around it when the mean is taken away. */
static rgb bounded(rgb off, rgb white) {
    rgb most = rgb_scale(white, OFF_MOST);
    return rgb_make(clampf(off.r, -most.r, most.r), clampf(off.g, -most.g, most.g), clampf(off.b, -most.b, most.b));
}

/* What a pixel shows beyond what the texture tells; of noise it should show none. NAN where it is not asked. */
static struct both pixel_off(const struct picture_job *job, uint32_t x, uint32_t y) {
    const struct detail *d = job->detail;
    const struct reconstruction *r = d->r;
    const struct photograph *photo = photograph_of(d, job->train);
    struct photograph_sample s;
    struct footprint f;
    struct both told;
    if (d->views->edge[job->train][(size_t)y * photo->camera.width + x] > 0 ||
        !photograph_sample(photo, (float)x + 0.5f, (float)y + 0.5f, &s) || s.saturated[0] || s.saturated[1] ||
        s.saturated[2] || !footprint_find(&f, &r->scene->mesh, &r->atlas, d->views->accel, &photo->camera, x, y) ||
        r->is_emitter[r->segments.of_triangle[f.triangle]] || !footprint_sends(d, &f, &told))
        return (struct both){{rgb_gray(NAN), rgb_gray(NAN)}};
    size_t middle = (size_t)f.middle.y * r->inverse.width + (size_t)f.middle.x;
    rgb white = rgb_from_half(d->white[middle]);
    return (struct both){{bounded(rgb_sub(s.radiance, told.of[VALUE]), white),
                          bounded(rgb_scale(told.of[NOISE], -1.0f), white)}};
}

static void find_row(void *user, size_t row, int thread) {
    (void)thread;
    const struct picture_job *job = user;
    uint32_t width = photograph_of(job->detail, job->train)->camera.width;
    for (uint32_t x = 0; x < width; x++)
        job->raw[row * width + x] = pixel_off(job, x, (uint32_t)row);
}

/* Takes away the mean of the same segment's pixels around each. */
static void flatten_row(void *user, size_t row, int thread) {
    (void)thread;
    const struct picture_job *job = user;
    const struct camera *camera = &photograph_of(job->detail, job->train)->camera;
    const uint8_t *owner = job->detail->views->owner[job->train];
    long width = (long)camera->width, height = (long)camera->height, y0 = (long)row;
    for (long x0 = 0; x0 < width; x0++) {
        size_t at = (size_t)(y0 * width + x0);
        struct both off = job->raw[at], sum = {{{0.0f, 0.0f, 0.0f}}};
        float count = 0.0f;
        for (long y = y0 > WINDOW ? y0 - WINDOW : 0; !isnan(off.of[VALUE].r) && y <= y0 + WINDOW && y < height; y++) {
            for (long x = x0 > WINDOW ? x0 - WINDOW : 0; x <= x0 + WINDOW && x < width; x++) {
                const struct both *beside = &job->raw[y * width + x];
                if (isnan(beside->of[VALUE].r) || owner[y * width + x] != owner[at])
                    continue;
                add(&sum, 1.0f, beside);
                count += 1.0f;
            }
        }
        add(&off, count < WINDOW_LEAST ? NAN : -1.0f / count, &sum);
        for (int kind = 0; kind < KINDS; kind++)
            rgb_to_half(job->detail->off[kind][job->train][at], off.of[kind]);
    }
}

static void make_picture(struct detail *d, uint32_t train) {
    const struct camera *camera = &photograph_of(d, train)->camera;
    struct picture_job job = {.detail = d, .train = train};
    job.raw = mem_array((size_t)camera->width * camera->height, sizeof *job.raw);
    parallel_for(d->r->pool, camera->height, find_row, &job);
    parallel_for(d->r->pool, camera->height, flatten_row, &job);
    mem_free(job.raw);
}

/* --- what it means for texels ------------------------------------------------------------------- */

/* Bilinear look-up in a picture; false where a pixel was not asked. */
static bool off_at(const struct detail *d, const struct view *view, int kind, rgb *off) {
    const struct camera *camera = &photograph_of(d, view->train)->camera;
    float fx = view->x - 0.5f, fy = view->y - 0.5f;
    long x = (long)floorf(fx), y = (long)floorf(fy), width = (long)camera->width;
    if (x < 0 || y < 0 || x + 1 >= width || y + 1 >= (long)camera->height)
        return false;
    float tx = fx - (float)x, ty = fy - (float)y;
    *off = rgb_gray(0.0f);
    for (int k = 0; k < 4; k++) {
        float weight = (k & 1 ? tx : 1.0f - tx) * (k & 2 ? ty : 1.0f - ty);
        *off = rgb_mad(*off, weight, rgb_from_half(d->off[kind][view->train][(y + (k >> 1)) * width + x + (k & 1)]));
    }
    return !isnan(off->r);
}

/* Weighted sums over the photographs of a texel. */
struct sums {
    float weight, weight_squared, of_half[2];
    rgb off[KINDS];
    rgb squared, crossed; /* of value: weight squared x its square; x itself */
};

static void add_photograph(struct sums *s, const struct detail *d, const struct view *view, uint32_t triangle,
                           rgb typical) {
    rgb value, noise;
    if (views_edge(d->views, view, triangle) > 0 || !off_at(d, view, VALUE, &value) || !off_at(d, view, NOISE, &noise))
        return;
    float weight = view->weight * noise_weight_of_brightness(&d->r->noise, photograph_of(d, view->train), typical);
    int half = halves_usual(view->train);
    s->weight += weight;
    s->weight_squared += weight * weight;
    s->of_half[half] += weight;
    s->off[VALUE] = rgb_mad(s->off[VALUE], weight, value);
    s->off[NOISE] = rgb_mad(s->off[NOISE], weight, rgb_mad(noise, half ? 1.0f : -1.0f, value));
    s->squared = rgb_mad(s->squared, weight * weight, rgb_mul(value, value));
    s->crossed = rgb_mad(s->crossed, weight * weight, value);
}

/* How far the photographs agree: the part of the mean's square that is not its variance. */
static float agreement(const struct sums *s) {
    rgb mean = rgb_scale(s->off[VALUE], 1.0f / s->weight);
    rgb scatter = rgb_mad(rgb_mad(s->squared, -2.0f, rgb_mul(mean, s->crossed)), s->weight_squared, rgb_mul(mean, mean));
    float power = rgb_dot(mean, mean), variance = 3.0f * rgb_mean(scatter) / (s->weight * s->weight);
    return power > variance ? 1.0f - variance / power : 0.0f;
}

static void move(uint16_t half[3], rgb by, rgb white) {
    rgb value = rgb_from_half(half);
    for (int c = 0; c < 3; c++) {
        float step = clampf(channels_of(&by)[c] / channels_of(&white)[c], -STEP_MOST, STEP_MOST);
        channels_of(&value)[c] = clampf(channels_of(&value)[c] + step, -BASE_MOST, BASE_MOST);
    }
    rgb_to_half(half, value);
}

static void step_texel(struct detail *d, uint32_t texel) {
    const struct reconstruction *r = d->r;
    struct surface_point at;
    struct sums s = {.weight = 0.0f};
    if (!is_known(d, texel) || !surface_at_texel(&r->scene->mesh, &r->atlas, &r->inverse, texel, &at))
        return;
    rgb white = rgb_from_half(d->white[texel]);
    for (uint32_t t = 0; t < d->views->train_count; t++) {
        struct view view;
        if (views_sees(d->views, t, at.position, at.normal, &view))
            add_photograph(&s, d, &view, at.triangle, rgb_scale(white, TYPICAL_BASE_COLOR));
    }
    if (!(s.weight > 0.0f) || fminf(s.of_half[0], s.of_half[1]) < HALF_LEAST * s.weight)
        return;
    float part = agreement(&s) / s.weight;
    move(d->measured[texel].value, rgb_scale(s.off[VALUE], part), white);
    move(d->measured[texel].noise, rgb_scale(s.off[NOISE], part), white);
}

static void step_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    struct detail *d = user;
    size_t begin = chunk * CHUNK, valid = d->r->inverse.valid_count, end = begin + CHUNK < valid ? begin + CHUNK : valid;
    for (size_t i = begin; i < end; i++)
        step_texel(d, d->r->inverse.valid[i]);
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

void detail_init(struct detail *d, const struct reconstruction *r, const struct views *views,
                 const uint16_t (*white)[3], struct measured *measured) {
    *d = (struct detail){.r = r, .views = views, .white = white, .measured = measured};
    for (int kind = 0; kind < KINDS; kind++) {
        d->off[kind] = mem_array(views->train_count, sizeof *d->off[kind]);
        for (uint32_t t = 0; t < views->train_count; t++) {
            const struct camera *camera = &photograph_of(d, t)->camera;
            d->off[kind][t] = mem_array((size_t)camera->width * camera->height, sizeof **d->off[kind]);
        }
    }
}

void detail_release(struct detail *d) {
    for (int kind = 0; kind < KINDS; kind++) {
        for (uint32_t t = 0; t < d->views->train_count; t++)
            mem_free(d->off[kind][t]);
        mem_free(d->off[kind]);
    }
    *d = (struct detail){0};
}

void detail_step(struct detail *d) {
    for (uint32_t t = 0; t < d->views->train_count; t++)
        make_picture(d, t);
    parallel_for(d->r->pool, (d->r->inverse.valid_count + CHUNK - 1) / CHUNK, step_chunk, d);
}
