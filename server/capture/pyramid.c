/* pyramid.c -- see pyramid.h. */
#include "server/capture/pyramid.h"

#include <math.h>

#include "common/mem.h"
#include "server/capture/views.h"

/* Pixels around a depth edge that are masked: a lens and a pose off by a pixel mix as far. */
#define EDGE_DISTANCE 2 /* to 3: no change */

static float gray_of(const struct photograph *photo, uint32_t x, uint32_t y, float floor) {
    struct photograph_sample s;
    float px = (float)x + 0.5f, py = (float)y + 0.5f;
    if (!photograph_sample(photo, px, py, &s) || photograph_sample_saturates(&s))
        return NAN;
    float gray = rgb_luminance(s.radiance);
    if (!photo->is_hdr && gray * photo->exposure * photograph_falloff(photo, px, py) < VIEWS_NOISE_VALUE)
        return NAN;
    return logf(fmaxf(gray, 0.0f) + floor);
}

/* Means over 2 x 2 pixels; an odd last row or column is left out. */
static float *halve(const float *from, uint32_t *width, uint32_t *height) {
    uint32_t w = *width / 2, h = *height / 2;
    float *to = mem_array((size_t)w * h + 1, sizeof *to);
    for (uint32_t y = 0; y < h; y++) {
        const float *a = from + (size_t)2 * y * *width, *b = a + *width;
        for (uint32_t x = 0; x < w; x++)
            to[(size_t)y * w + x] = 0.25f * (a[2 * x] + a[2 * x + 1] + b[2 * x] + b[2 * x + 1]);
    }
    *width = w;
    *height = h;
    return to;
}

/* 1 2 1 in both directions, the border repeated. */
static void smooth(float *value, uint32_t width, uint32_t height) {
    if (width == 0 || height == 0)
        return;
    float *above = mem_array(width, sizeof *above), *row = mem_array(width, sizeof *row);
    for (uint32_t y = 0; y < height; y++) {
        float *at = value + (size_t)y * width;
        for (uint32_t x = 0; x < width; x++)
            row[x] = 0.25f * at[x ? x - 1 : 0] + 0.5f * at[x] + 0.25f * at[x + 1 < width ? x + 1 : x];
        for (uint32_t x = 0; x < width; x++)
            at[x] = row[x];
    }
    for (uint32_t x = 0; x < width; x++)
        above[x] = value[x];
    for (uint32_t y = 0; y < height; y++) {
        float *at = value + (size_t)y * width;
        const float *below = y + 1 < height ? at + width : at;
        for (uint32_t x = 0; x < width; x++) {
            row[x] = at[x];
            at[x] = 0.25f * above[x] + 0.5f * at[x] + 0.25f * below[x];
        }
        float *swap = above;
        above = row;
        row = swap;
    }
    mem_free(row);
    mem_free(above);
}

static void mask_edges(float *value, uint32_t width, uint32_t height, const uint8_t *shows) {
    long w = (long)width, h = (long)height;
    for (long i = 0; i < w * h; i++) {
        if (shows[i] == VIEWS_SURFACE || shows[i] == VIEWS_SEAM)
            continue;
        long x0 = i % w - EDGE_DISTANCE, x1 = i % w + EDGE_DISTANCE;
        long y0 = i / w - EDGE_DISTANCE, y1 = i / w + EDGE_DISTANCE;
        for (long y = y0 < 0 ? 0 : y0; y <= y1 && y < h; y++)
            for (long x = x0 < 0 ? 0 : x0; x <= x1 && x < w; x++)
                value[y * w + x] = NAN;
    }
}

void pyramid_make(struct pyramid *p, const struct photograph *photo, const uint8_t *shows, size_t pixels, float floor) {
    uint32_t w = photo->camera.width, h = photo->camera.height;
    *p = (struct pyramid){.scale = 1.0f};
    float *raw = mem_array((size_t)w * h, sizeof *raw);
    for (uint32_t y = 0; y < h; y++)
        for (uint32_t x = 0; x < w; x++)
            raw[(size_t)y * w + x] = gray_of(photo, x, y, floor);
    if (shows)
        mask_edges(raw, w, h, shows);
    while ((size_t)w * h > pixels && w > 1 && h > 1) {
        float *half = halve(raw, &w, &h);
        mem_free(raw);
        raw = half;
        p->scale *= 0.5f;
    }
    for (int level = 0; level < PYRAMID_LEVELS; level++) {
        p->width[level] = w;
        p->height[level] = h;
        p->value[level] = raw;
        if (level + 1 < PYRAMID_LEVELS)
            raw = halve(raw, &w, &h);
        smooth(p->value[level], p->width[level], p->height[level]);
    }
}

void pyramid_release(struct pyramid *p) {
    for (int level = 0; level < PYRAMID_LEVELS; level++)
        mem_free(p->value[level]);
    *p = (struct pyramid){0};
}

/* Bilinear look-up at position (x, y) of a level; NaN outside. */
static float bilinear(const struct pyramid *p, int level, float x, float y) {
    float u = x - 0.5f, v = y - 0.5f;
    uint32_t w = p->width[level], h = p->height[level];
    if (!(u >= 0.0f && v >= 0.0f && u < (float)w - 1.0f && v < (float)h - 1.0f))
        return NAN;
    size_t column = (size_t)u, row = (size_t)v;
    const float *a = p->value[level] + row * w + column, *b = a + w;
    float s = u - (float)column, t = v - (float)row;
    return (1.0f - t) * ((1.0f - s) * a[0] + s * a[1]) + t * ((1.0f - s) * b[0] + s * b[1]);
}

static float scale_of(const struct pyramid *p, int level) { return p->scale / (float)(1 << level); }

float pyramid_value(const struct pyramid *p, int level, float x, float y) {
    float scale = scale_of(p, level);
    return bilinear(p, level, x * scale, y * scale);
}

bool pyramid_gradient(const struct pyramid *p, int level, float x, float y, float *value, float gradient[2]) {
    float scale = scale_of(p, level);
    x *= scale;
    y *= scale;
    *value = bilinear(p, level, x, y);
    gradient[0] = 0.5f * scale * (bilinear(p, level, x + 1.0f, y) - bilinear(p, level, x - 1.0f, y));
    gradient[1] = 0.5f * scale * (bilinear(p, level, x, y + 1.0f) - bilinear(p, level, x, y - 1.0f));
    return isfinite(*value) && isfinite(gradient[0]) && isfinite(gradient[1]);
}
