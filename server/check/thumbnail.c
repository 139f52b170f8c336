/* thumbnail.c -- see thumbnail.h. */
#include "server/check/thumbnail.h"

#include <math.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "server/scene/rgb_half.h"

#define TAPS 4 /* pixels averaged along each axis of a thumbnail's pixel, at most; to 5: no verdict */
/* Half the side of the neighbourhood, pixels of the thumbnail: shading of a whole wall is no detail. */
#define NEIGHBOURHOOD 8 /* +25 %: no verdict, correlations +0.02 to +0.04 */
/* Of the median, added before the logarithm: noise in the dark is no detail. */
#define FLOOR_SHARE 0.05f /* +25 %: no verdict */
/* Detail is more than this; it is three times the noise of the mean of 3 x 3 pixels. */
#define DETAIL_OF_NOISE 1.0f /* +25 %: no verdict */
#define MEDIAN_OF_MAX 2048   /* values; +25 %: no verdict */
/* Of the compression's half-way point: half of the noise that averaged pixels may have. */
#define CONTRAST_MIN 0.02f /* +25 %: no verdict */

/* Mean luminance of a block of the photograph's pixels; NAN where none is usable. */
static float block_mean(const struct photograph *photo, const uint32_t from[2], const uint32_t to[2]) {
    uint32_t step_x = (to[0] - from[0] + TAPS - 1) / TAPS, step_y = (to[1] - from[1] + TAPS - 1) / TAPS;
    float sum = 0.0f, count = 0.0f;
    for (uint32_t y = from[1]; y < to[1]; y += step_y) {
        photograph_use(photo, (size_t)y * photo->camera.width + from[0], to[0] - from[0]);
        for (uint32_t x = from[0]; x < to[0]; x += step_x) {
            size_t at = (size_t)y * photo->camera.width + x;
            float value = rgb_luminance(rgb_from_half(photo->pixel[at]));
            if ((photo->mask && photo->mask[at] == 0) || !isfinite(value))
                continue;
            sum += value;
            count += 1.0f;
        }
    }
    return count > 0.0f ? sum / count : NAN;
}

static void reduce(const struct thumbnail *t, const struct photograph *photo, float *out) {
    uint64_t width = photo->camera.width, height = photo->camera.height;
    for (uint32_t y = 0; y < t->height; y++)
        for (uint32_t x = 0; x < t->width; x++) {
            uint32_t from[2] = {(uint32_t)(x * width / t->width), (uint32_t)(y * height / t->height)};
            uint32_t to[2] = {(uint32_t)((x + 1) * width / t->width), (uint32_t)((y + 1) * height / t->height)};
            out[(size_t)y * t->width + x] = block_mean(photo, from, to);
        }
}

/* Of every few values, which is close enough. */
static float median_of(const float *value, size_t count, bool absolute) {
    float sorted[MEDIAN_OF_MAX];
    size_t kept = 0, step = count / MEDIAN_OF_MAX + 1;
    for (size_t i = 0; i < count; i += step)
        if (isfinite(value[i]))
            sorted[kept++] = absolute ? fabsf(value[i]) : value[i];
    return quantile(sorted, kept, 0.5);
}

/* Means over the square of `radius` around each pixel, of the finite values there. */
static void box_mean(const float *in, uint32_t width, uint32_t height, int radius, float *out) {
    size_t stride = (size_t)width + 1;
    double *sum = mem_calloc(stride * ((size_t)height + 1), sizeof *sum); /* of all above and to the left */
    double *count = mem_calloc(stride * ((size_t)height + 1), sizeof *count);
    for (size_t y = 0; y < height; y++)
        for (size_t x = 0; x < width; x++) {
            float value = in[y * width + x];
            size_t at = (y + 1) * stride + x + 1;
            sum[at] = sum[at - 1] + sum[at - stride] - sum[at - stride - 1] + (isfinite(value) ? (double)value : 0.0);
            count[at] = count[at - 1] + count[at - stride] - count[at - stride - 1] + (isfinite(value) ? 1.0 : 0.0);
        }
    for (int y = 0; y < (int)height; y++)
        for (int x = 0; x < (int)width; x++) {
            size_t x0 = (size_t)(x > radius ? x - radius : 0), y0 = (size_t)(y > radius ? y - radius : 0);
            size_t x1 = x + radius + 1 < (int)width ? (size_t)(x + radius + 1) : width;
            size_t y1 = y + radius + 1 < (int)height ? (size_t)(y + radius + 1) : height;
            size_t a = y1 * stride + x1, b = y1 * stride + x0, c = y0 * stride + x1, d = y0 * stride + x0;
            double n = count[a] - count[b] - count[c] + count[d];
            out[(size_t)y * width + (size_t)x] = n > 0.0 ? (float)((sum[a] - sum[b] - sum[c] + sum[d]) / n) : NAN;
        }
    mem_free(count);
    mem_free(sum);
}

/* Standard deviation of the noise of single pixels, by a mask that is blind to edges and ramps (Immerkaer 1996); fine
 * texture counts as noise. */
static float noise_of(const float *level, uint32_t width, uint32_t height) {
    double sum = 0.0, count = 0.0;
    for (size_t y = 1; y + 1 < height; y++)
        for (size_t x = 1; x + 1 < width; x++) {
            const float *at = level + y * width + x, *up = at - width, *down = at + width;
            float value =
                up[-1] + up[1] + down[-1] + down[1] - 2.0f * (up[0] + down[0] + at[-1] + at[1]) + 4.0f * at[0];
            if (!isfinite(value))
                continue;
            sum += (double)fabsf(value);
            count += 1.0;
        }
    return count > 0.0 ? (float)(sqrt(0.5 * PI) * sum / (6.0 * count)) : 0.0f;
}

void thumbnail_make(struct thumbnail *t, const struct photograph *photo) {
    uint32_t width = photo->camera.width, height = photo->camera.height;
    uint32_t side = width > height ? width : height;
    t->width = side > THUMBNAIL_WIDTH ? (uint32_t)((uint64_t)width * THUMBNAIL_WIDTH / side) : width;
    t->height = side > THUMBNAIL_WIDTH ? (uint32_t)((uint64_t)height * THUMBNAIL_WIDTH / side) : height;
    t->width += t->width == 0;
    t->height += t->height == 0;
    size_t count = (size_t)t->width * t->height, detailed = 0;
    float *level = mem_array(count, sizeof *level), *around = mem_array(count, sizeof *around);
    t->value = mem_array(count, sizeof *t->value);
    reduce(t, photo, level);
    t->brightness = median_of(level, count, false);
    float least = FLOOR_SHARE * t->brightness + 1e-6f;
    for (size_t i = 0; i < count; i++)
        level[i] = logf(fmaxf(level[i], 0.0f) + least) + 0.0f * level[i]; /* NAN stays NAN */
    float detail = fmaxf(THUMBNAIL_DETAIL, DETAIL_OF_NOISE * noise_of(level, t->width, t->height));
    box_mean(level, t->width, t->height, NEIGHBOURHOOD, around);
    box_mean(level, t->width, t->height, 1, t->value);
    for (size_t i = 0; i < count; i++) {
        t->value[i] = isfinite(level[i]) ? t->value[i] - around[i] : NAN;
        detailed += fabsf(t->value[i]) > detail;
    }
    t->detail = (float)detailed / (float)count;
    float half_way = fmaxf(median_of(t->value, count, true), CONTRAST_MIN);
    for (size_t i = 0; i < count; i++)
        t->value[i] /= sqrtf(t->value[i] * t->value[i] + half_way * half_way);
    mem_free(around);
    mem_free(level);
}

void thumbnail_release(struct thumbnail *t) {
    mem_free(t->value);
    t->value = NULL;
}

float thumbnail_value(const struct thumbnail *t, float u, float v) {
    float x = clampf(u * (float)t->width - 0.5f, 0.0f, (float)(t->width - 1));
    float y = clampf(v * (float)t->height - 0.5f, 0.0f, (float)(t->height - 1));
    uint32_t x0 = (uint32_t)x, y0 = (uint32_t)y, x1 = x0 + (x0 + 1 < t->width), y1 = y0 + (y0 + 1 < t->height);
    float fx = x - (float)x0, fy = y - (float)y0;
    const float *top = t->value + (size_t)y0 * t->width, *bottom = t->value + (size_t)y1 * t->width;
    float value =
        (1.0f - fy) * ((1.0f - fx) * top[x0] + fx * top[x1]) + fy * ((1.0f - fx) * bottom[x0] + fx * bottom[x1]);
    return isfinite(value) ? value : 0.0f;
}
