/* even.c -- see even.h. */
#include "server/evaluate/even.h"

#include <math.h>
#include <string.h>

#include "server/reconstruct/metrics.h"

#define REACH 3 /* pixels around, along each side: 7 x 7 */
/* Weights of these by least squares, for the value in the middle of a quadratic: 1/49 - 4 (u^2 + v^2 - 8) / 588, 4 being
 * the mean of u^2 and 588 the sum of (u^2 - 4)^2. Noise of which the middle one has a part is left by 1 less its weight. */
#define WEIGHT(u, v) (1.0 / 49.0 - 4.0 * ((u) * (u) + (v) * (v) - 8.0) / 588.0)
#define SAME_COLOR 0.005f /* base colours no further apart are the same */
#define LEAST_ROUGHNESS 0.5f

/* Where the channels of the truth are. */
struct even_columns {
    int color[3], roughness, object;
};

static const float *pixel_at(const struct image *image, uint32_t x, uint32_t y) {
    return image->pixel + ((size_t)y * image->width + x) * image->channel_count;
}

static bool is_same(const float *a, const float *b, const struct even_columns *at) {
    for (int c = 0; c < 3; c++) {
        if (fabsf(a[at->color[c]] - b[at->color[c]]) > SAME_COLOR)
            return false;
    }
    return a[at->object] == b[at->object];
}

/* What a pixel should show by those around it; false where that is not even. */
static bool told_around(const struct image *photograph, const struct image *truth, const struct even_columns *at, uint32_t x,
                        uint32_t y, float told[3]) {
    const float *middle = pixel_at(truth, x, y);
    double sum[3] = {0.0, 0.0, 0.0};
    if (middle[at->object] < 0.0f || middle[at->roughness] < LEAST_ROUGHNESS)
        return false;
    for (int v = -REACH; v <= REACH; v++) {
        for (int u = -REACH; u <= REACH; u++) {
            uint32_t column = (uint32_t)((int)x + u), row = (uint32_t)((int)y + v);
            if (!is_same(pixel_at(truth, column, row), middle, at))
                return false;
            for (int c = 0; c < 3; c++)
                sum[c] += WEIGHT(u, v) * (double)pixel_at(photograph, column, row)[c];
        }
    }
    for (int c = 0; c < 3; c++)
        told[c] = (float)sum[c];
    return isfinite(sum[0]) && isfinite(sum[1]) && isfinite(sum[2]);
}

/* Makes a picture of what pixels should show where all is even, and NaN elsewhere, which metrics leave out. Returns the
 * number of the former. */
static size_t tell(const struct image *photograph, const struct image *truth, struct image *told) {
    const struct even_columns at = {
        {image_channel(truth, "base_color.R"), image_channel(truth, "base_color.G"), image_channel(truth, "base_color.B")},
        image_channel(truth, "roughness"), image_channel(truth, "object_id")};
    size_t count = 0;
    image_init_rgb(told, truth->width, truth->height);
    for (size_t i = 0; i < 3 * (size_t)truth->width * truth->height; i++)
        told->pixel[i] = NAN;
    for (uint32_t y = REACH; y + REACH < truth->height; y++) {
        for (uint32_t x = REACH; x + REACH < truth->width; x++) {
            float around[3];
            if (!told_around(photograph, truth, &at, x, y, around))
                continue;
            memcpy(told->pixel + 3 * ((size_t)y * truth->width + x), around, sizeof around);
            count++;
        }
    }
    return count;
}

void even_add(struct even *even, const struct image *photograph, const struct image *render, const struct image *truth,
              double median_radiance) {
    struct image shown;
    size_t count = tell(photograph, truth, &shown);
    if (count > 0) {
        even->noise += (double)count * metrics_msre(photograph, &shown, median_radiance) / (1.0 - WEIGHT(0, 0));
        for (size_t i = 0; i < 3 * (size_t)truth->width * truth->height; i++)
            shown.pixel[i] = isfinite(shown.pixel[i]) ? render->pixel[i] : NAN;
        even->render += (double)count * metrics_msre(photograph, &shown, median_radiance);
        even->count += count;
    }
    image_release(&shown);
}
