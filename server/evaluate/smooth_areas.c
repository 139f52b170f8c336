/* smooth_areas.c -- see smooth_areas.h. */
#include "server/evaluate/smooth_areas.h"

#include <math.h>
#include <string.h>

#include "server/reconstruct/metrics.h"

#define RADIUS 3 /* pixels, of the 7 x 7 window */
/* Least-squares weights for the value of a quadratic at the window's centre: 1/49 - 4 (u^2 + v^2 - 8) / 588, with 4
 * the mean of u^2 and 588 the sum of (u^2 - 4)^2. The centre pixel contributes to its own estimate, so 1 - WEIGHT(0,
 * 0) of its noise variance remains in the difference. */
#define WEIGHT(u, v) (1.0 / 49.0 - 4.0 * ((u) * (u) + (v) * (v)-8.0) / 588.0)
#define MAX_COLOR_DIFFERENCE 0.005f /* base colours that differ less are the same */
#define MIN_ROUGHNESS 0.5f

/* Indices of the truth's channels. */
struct truth_channels {
    int color[3], roughness, object;
};

static const float *pixel_at(const struct image *image, uint32_t x, uint32_t y) {
    return image->pixel + ((size_t)y * image->width + x) * image->channel_count;
}

static bool same_surface(const float *a, const float *b, const struct truth_channels *at) {
    for (int c = 0; c < 3; c++) {
        if (fabsf(a[at->color[c]] - b[at->color[c]]) > MAX_COLOR_DIFFERENCE)
            return false;
    }
    return a[at->object] == b[at->object];
}

/* Expected value of a pixel from its window; false when the window is not smooth. */
static bool smoothed_pixel(const struct image *photograph, const struct image *truth, const struct truth_channels *at,
                           uint32_t x, uint32_t y, float smoothed[3]) {
    const float *centre = pixel_at(truth, x, y);
    double sum[3] = {0.0, 0.0, 0.0};
    if (centre[at->object] < 0.0f || centre[at->roughness] < MIN_ROUGHNESS)
        return false;
    for (int v = -RADIUS; v <= RADIUS; v++) {
        for (int u = -RADIUS; u <= RADIUS; u++) {
            uint32_t column = (uint32_t)((int)x + u), row = (uint32_t)((int)y + v);
            if (!same_surface(pixel_at(truth, column, row), centre, at))
                return false;
            for (int c = 0; c < 3; c++)
                sum[c] += WEIGHT(u, v) * (double)pixel_at(photograph, column, row)[c];
        }
    }
    for (int c = 0; c < 3; c++)
        smoothed[c] = (float)sum[c];
    return isfinite(sum[0]) && isfinite(sum[1]) && isfinite(sum[2]);
}

/* Makes two equal pictures of expected values (halves, metrics.h), NaN where the scene is not smooth, which metrics
 * leave out. Returns the number of smooth pixels. */
static size_t smooth_picture(const struct image *photograph, const struct image *truth, struct image *smoothed) {
    const struct truth_channels at = {{image_channel(truth, "base_color.R"), image_channel(truth, "base_color.G"),
                                       image_channel(truth, "base_color.B")},
                                      image_channel(truth, "roughness"),
                                      image_channel(truth, "object_id")};
    size_t count = 0;
    image_init(smoothed, truth->width, truth->height, 6,
               (const char *const[]){"a.R", "a.G", "a.B", "b.R", "b.G", "b.B"});
    for (size_t i = 0; i < 6 * (size_t)truth->width * truth->height; i++)
        smoothed->pixel[i] = NAN;
    for (uint32_t y = RADIUS; y + RADIUS < truth->height; y++) {
        for (uint32_t x = RADIUS; x + RADIUS < truth->width; x++) {
            float value[3];
            if (!smoothed_pixel(photograph, truth, &at, x, y, value))
                continue;
            for (size_t half = 0; half < 2; half++)
                memcpy(smoothed->pixel + 6 * ((size_t)y * truth->width + x) + 3 * half, value, sizeof value);
            count++;
        }
    }
    return count;
}

void smooth_areas_add(struct smooth_areas *areas, const struct image *photograph, const struct image *halves,
                      const struct image *truth, double median_radiance) {
    struct image expected;
    size_t count = smooth_picture(photograph, truth, &expected);
    if (count > 0) {
        areas->noise +=
            (double)count * metrics_msre(photograph, &expected, median_radiance).value / (1.0 - WEIGHT(0, 0));
        for (size_t i = 0; i < 6 * (size_t)truth->width * truth->height; i++)
            expected.pixel[i] = isfinite(expected.pixel[i]) ? halves->pixel[i] : NAN;
        areas->render += (double)count * metrics_msre(photograph, &expected, median_radiance).value;
        areas->count += count;
    }
    image_release(&expected);
}
