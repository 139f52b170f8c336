/* photograph.c -- see photograph.h. */
#include "server/scene/photograph.h"

#include <assert.h>
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "common/mem.h"

void photograph_release(struct photograph *photo) {
    mem_free(photo->name);
    spill_give(photo->spill, photo->pixel);
    spill_give(photo->spill, photo->saturated);
    spill_give(photo->spill, photo->clipped);
    mem_free(photo->color_space);
    spill_give(photo->spill, photo->firefly);
    spill_give(photo->spill, photo->mask);
    *photo = (struct photograph){0};
}

struct camera photograph_file_camera(const struct photograph *photo) {
    struct camera camera = photo->camera;
    if (photo->file.step <= 1)
        return camera;
    float step = (float)photo->file.step;
    camera.width = photo->file.width;
    camera.height = photo->file.height;
    camera.fx *= step;
    camera.fy *= step;
    camera.cx *= step;
    camera.cy *= step;
    return camera;
}

static void use_plane(const struct photograph *photo, const void *plane, size_t size, size_t at, size_t count) {
    if (plane)
        spill_use(photo->spill, (const char *)plane + at * size, count * size);
}

void photograph_use(const struct photograph *photo, size_t at, size_t count) {
    if (!spill_has_file(photo->spill))
        return;
    use_plane(photo, photo->pixel, sizeof *photo->pixel, at, count);
    use_plane(photo, photo->saturated, sizeof *photo->saturated, at, count);
    use_plane(photo, photo->clipped, sizeof *photo->clipped, at, count);
    use_plane(photo, photo->firefly, sizeof *photo->firefly, at, count);
    use_plane(photo, photo->mask, sizeof *photo->mask, at, count);
}

/* The pixels of `rows` rows of `columns`. */
static inline void use_taps(const struct photograph *photo, size_t row, size_t rows, size_t column, size_t columns) {
    for (size_t y = row; spill_has_file(photo->spill) && y < row + rows; y++)
        photograph_use(photo, y * photo->camera.width + column, columns);
}

/* image_float_from_half, inlined: a lookup converts twelve values, and a refinement does millions of lookups per
 * iteration. No step produces a subnormal float, so results do not depend on flush-to-zero. */
static inline float half_to_float(uint16_t half) {
    uint32_t exponent = (half >> 10) & 31u, mantissa = half & 1023u;
    float magnitude;
    if (exponent == 0) {
        magnitude = (float)mantissa * 0x1p-24f;
    } else {
        uint32_t bits = (exponent == 31 ? 255u : exponent + 112u) << 23 | mantissa << 13;
        memcpy(&magnitude, &bits, sizeof magnitude);
    }
    return half & 0x8000u ? -magnitude : magnitude;
}

/* The pixel value; slightly negative for a stored 0 (see photograph.h). */
static inline float read_tap(const struct photograph *photo, uint16_t half) {
    float value = half_to_float(half);
    return value == 0.0f ? -photo->black : value;
}

/* Whether a channel is saturated; raises its value to the clip if so. */
static inline bool tap_saturates(const struct photograph *photo, size_t at, int channel, float *tap) {
    bool is_saturated =
        photo->saturated ? photo->saturated[at] >> channel & 1 : photograph_clips(photo, at, channel, *tap);
    if (is_saturated)
        *tap = fmaxf(*tap, photo->clip);
    return is_saturated;
}

float photograph_value(const struct photograph *photo, size_t at, int channel, bool *is_saturated) {
    float value = read_tap(photo, photo->pixel[at][channel]);
    *is_saturated = tap_saturates(photo, at, channel, &value);
    return value;
}

/* The two pixels around coordinate x in a row of `count` pixels, and the weight of the second. */
static inline void taps(float x, uint32_t count, size_t index[2], float *weight) {
    float centred = clampf(x - 0.5f, 0.0f, (float)(count - 1));
    index[0] = (size_t)centred;
    index[1] = index[0] + 1 < count ? index[0] + 1 : index[0];
    *weight = centred - (float)index[0];
}

float photograph_falloff(const struct photograph *photo, float x, float y) {
    const float *v = photo->vignette;
    if (v[0] == 0.0f && v[1] == 0.0f && v[2] == 0.0f)
        return 1.0f;
    float s = photograph_radius(photo, x, y);
    return expf(s * (v[0] + s * (v[1] + s * v[2])));
}

bool photograph_sample(const struct photograph *photo, float x, float y, struct photograph_sample *sample) {
    uint32_t width = photo->camera.width, height = photo->camera.height;
    assert(width > 0 && height > 0);
    size_t column[2], row[2];
    float wx, wy;
    taps(x, width, column, &wx);
    taps(y, height, row, &wy);
    use_taps(photo, row[0], row[1] - row[0] + 1, column[0], column[1] - column[0] + 1);
    float value[3] = {0.0f, 0.0f, 0.0f};
    sample->saturated[0] = sample->saturated[1] = sample->saturated[2] = false;
    for (int k = 0; k < 4; k++) {
        float weight = (k & 1 ? wx : 1.0f - wx) * (k & 2 ? wy : 1.0f - wy);
        if (weight == 0.0f)
            continue;
        size_t at = row[k >> 1] * width + column[k & 1];
        if (photo->mask && photo->mask[at] == 0)
            return false;
        for (int c = 0; c < 3; c++) {
            float tap = read_tap(photo, photo->pixel[at][c]);
            sample->saturated[c] |= tap_saturates(photo, at, c, &tap);
            value[c] += weight * tap;
        }
    }
    if (!isfinite(value[0]) || !isfinite(value[1]) || !isfinite(value[2]))
        return false;
    float scale = photo->exposure * photograph_falloff(photo, x, y);
    float r = 1.0f / (scale * photo->gain.r), g = 1.0f / (scale * photo->gain.g), b = 1.0f / (scale * photo->gain.b);
    sample->radiance = rgb_make(value[0] * r, value[1] * g, value[2] * b);
    sample->clip_radiance = rgb_make(photo->clip * r, photo->clip * g, photo->clip * b);
    return true;
}

bool photograph_has_firefly(const struct photograph *photo, float x, float y) {
    size_t column[2], row[2];
    float wx, wy;
    taps(x, photo->camera.width, column, &wx);
    taps(y, photo->camera.height, row, &wy);
    use_taps(photo, row[0], row[1] - row[0] + 1, column[0], column[1] - column[0] + 1);
    for (int k = 0; k < 4 && photo->firefly; k++) {
        float weight = (k & 1 ? wx : 1.0f - wx) * (k & 2 ? wy : 1.0f - wy);
        if (weight > 0.0f && photo->firefly[row[k >> 1] * photo->camera.width + column[k & 1]])
            return true;
    }
    return false;
}

bool photograph_sample_cubic(const struct photograph *photo, float x, float y, rgb *radiance) {
    long width = (long)photo->camera.width, height = (long)photo->camera.height;
    long column = (long)floorf(x - 0.5f) - 1, row = (long)floorf(y - 0.5f) - 1;
    if (column < 0 || row < 0 || column + 4 > width || row + 4 > height)
        return false;
    float wx[4], wy[4], value[3] = {0.0f, 0.0f, 0.0f};
    photograph_cubic(x - 0.5f - (float)(column + 1), wx);
    photograph_cubic(y - 0.5f - (float)(row + 1), wy);
    use_taps(photo, (size_t)row, 4, (size_t)column, 4);
    for (long k = 0; k < 16; k++) {
        size_t at = (size_t)((row + k / 4) * width + column + k % 4);
        if ((photo->mask && photo->mask[at] == 0) || (photo->firefly && photo->firefly[at]))
            return false;
        for (int c = 0; c < 3; c++) {
            float tap = read_tap(photo, photo->pixel[at][c]);
            if (tap_saturates(photo, at, c, &tap) || !isfinite(tap))
                return false;
            value[c] += wx[k % 4] * wy[k / 4] * tap;
        }
    }
    if (!isfinite(value[0]) || !isfinite(value[1]) || !isfinite(value[2]))
        return false;
    float scale = 1.0f / (photo->exposure * photograph_falloff(photo, x, y));
    *radiance =
        rgb_make(value[0] * scale / photo->gain.r, value[1] * scale / photo->gain.g, value[2] * scale / photo->gain.b);
    return true;
}

struct photograph_ring photograph_ring(const struct photograph *photo, float x, float y, float radius_px) {
    static const float along[8][2] = {{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}};
    struct photograph_ring ring = {.darkest = INFINITY};
    bool saturates[8] = {false};
    for (int i = 0; i < 8; i++) {
        struct photograph_sample at;
        float px = x + radius_px * along[i][0], py = y + radius_px * along[i][1];
        if (px < 0.0f || py < 0.0f || px >= (float)photo->camera.width || py >= (float)photo->camera.height ||
            !photograph_sample(photo, px, py, &at))
            continue;
        float brightness = rgb_mean(at.radiance);
        ring.brightest = fmaxf(ring.brightest, brightness);
        ring.darkest = fminf(ring.darkest, brightness);
        ring.sum += brightness;
        ring.count += 1.0f;
        saturates[i] = photograph_sample_saturates(&at);
    }
    for (int i = 0; i < 4; i++)
        ring.saturated_pairs += saturates[i] && saturates[i + 4];
    return ring;
}
