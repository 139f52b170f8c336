/* noise.c -- see noise.h. */
#include "server/capture/noise.h"

#include <math.h>

#include "common/image.h"
#include "common/mem.h"
#include "common/quantile.h"
#include "common/rng.h"

#define MIN_EXPONENT (-24) /* first octave: from 2^-24, the smallest half */
/* Differences kept for each octave, and least number: with fewer it takes the share of the octave below. The standard
 * error of a lower quartile of n half-normal values is 1.8 / sqrt(n) of it: 2 % and 8 %. */
#define SAMPLES 8192    /* +25 %: 0 dB */
#define MIN_SAMPLES 512 /* +25 %: no change */
/* Quantile of the differences that is read. Lower ones see less texture, but need more samples, and of 8-bit pictures
 * they are 0 where neighbours are equal. */
#define QUANTILE 0.25               /* +25 %: +0.05 dB */
#define QUANTILE_DEVIATIONS 0.3186f /* that quantile of |x| for standard normal x; +25 %: -0.06 dB */
/* Var(b - (a + c) / 2) over that of one pixel. */
#define DIFFERENCE_VARIANCE 1.5f /* +25 %: -0.01 dB */
#define MAX_SHARE 1.0f           /* noise as large as the value: nothing is known; +25 %: 0 dB */
/* Share of MAX_SHARE from which an octave counts as lost in noise: at the bound, but for the quantile's error. */
#define LOST_SHARE 0.97f /* +25 %: no change */
/* Normal noise of deviation 1 clipped at 0 has a mean .4 too bright where the true value is 0, and .08 where it is 1.
 * With clipped values read as minus this, the error is .1 at most in both directions. */
#define BLACK_DEVIATIONS 0.6f /* +25 %: no change */
/* Floor of the relative deviation: what errors of poses and colours leave between photographs that are noiseless;
 * twice the rounding of 8-bit sRGB at mid grey. */
#define MIN_SHARE 0.01f /* +25 %: no change */
/* Blocks: least number of differences, for an error of a seventh of their median; bounds of the factor, since a block
 * has no more than 768 differences and its texture is not always smooth: what is beyond is taken for an error. */
#define MIN_DIFFERENCES 64 /* +25 %: 0 dB */
#define SCALE_MIN 0.5f     /* +25 %: +0.05 dB */
#define SCALE_MAX 4.0f     /* +25 %: no change */

/* Differences of one octave: an even sample of those offered (reservoir sampling, Vitter 1985). */
struct octave {
    uint64_t offered;
    float sample[SAMPLES];
};

static int octave_of(float value) {
    int exponent = MIN_EXPONENT;
    if (value > 0.0f)
        frexpf(value, &exponent);
    int octave = exponent - MIN_EXPONENT;
    return octave < 0 ? 0 : octave >= NOISE_OCTAVES ? NOISE_OCTAVES - 1 : octave;
}

static float middle_of(int octave) { return ldexpf(0.75f, octave + MIN_EXPONENT); }

static void offer(struct octave *octave, float difference) {
    uint64_t at = octave->offered++;
    if (at >= SAMPLES)
        at = rng_mix64(at) % (at + 1);
    if (at < SAMPLES)
        octave->sample[at] = difference;
}

/* Deviation of rounding to 8-bit sRGB, as a share of the linear value: equal neighbouring pixels do not mean that there
 * is no noise. */
static float rounding_share(float value) {
    float slope = value < 0.0031308f ? 1.0f / 12.92f : 2.4f / 1.055f * powf(value, 1.4f / 2.4f);
    return slope / (255.0f * sqrtf(12.0f) * value);
}

/* Differences of pixel (x, y) from the mean of those `lag` to its left and right, as shares of the mean of the three,
 * for each usable channel; returns how many. None where a pixel mixes surfaces, is masked or clipped. */
static int differences(const struct photograph *photo, const uint8_t *edge, uint32_t x, uint32_t y, uint32_t lag,
                       float mean[3], float difference[3]) {
    size_t at = (size_t)y * photo->camera.width + x;
    if (x < lag || x + lag >= photo->camera.width)
        return 0;
    const size_t pixel[3] = {at - lag, at, at + lag};
    for (int k = 0; k < 3; k++) {
        if (edge[pixel[k]] == VIEWS_EDGE || (photo->mask && !photo->mask[pixel[k]]))
            return 0;
    }
    int count = 0;
    for (int c = 0; c < 3; c++) {
        float value[3];
        for (int k = 0; k < 3; k++)
            value[k] = image_float_from_half(photo->pixel[pixel[k]][c]);
        float m = (value[0] + value[1] + value[2]) / 3.0f;
        if (!(m > 0.0f) || !isfinite(m) || fmaxf(value[0], fmaxf(value[1], value[2])) >= photo->clip)
            continue;
        mean[count] = m;
        difference[count++] = fabsf(value[1] - 0.5f * (value[0] + value[2])) / m;
    }
    return count;
}

static void use_row(const struct photograph *photo, const uint8_t *edge, uint32_t y) {
    size_t width = photo->camera.width;
    photograph_use(photo, y * width, width);
    spill_use(photo->spill, edge + y * width, width);
}

static void add_row(struct octave *octaves, const struct photograph *photo, const uint8_t *edge, uint32_t y) {
    use_row(photo, edge, y);
    for (uint32_t x = 0; x < photo->camera.width; x++) {
        float mean[3], difference[3];
        int count = differences(photo, edge, x, y, 1, mean, difference);
        for (int i = 0; i < count; i++)
            offer(&octaves[octave_of(mean[i])], difference[i]);
    }
}

/* Deviation of the darkest 8-bit values that are not lost in noise. */
static float darkest_deviation(const struct noise *noise) {
    for (int k = 0; k < NOISE_OCTAVES; k++)
        if (noise->share[k] < LOST_SHARE * MAX_SHARE)
            return noise->share[k] * middle_of(k);
    return 0.0f;
}

static void measure_shares(struct noise *noise, const struct views *v) {
    struct octave *octaves = mem_calloc(NOISE_OCTAVES, sizeof *octaves);
    bool rounded = false;
    for (size_t t = 0; t < v->train_count; t++) {
        const struct photograph *photo = &v->scene->photograph[v->train[t]];
        for (uint32_t y = 0; y < photo->camera.height; y++)
            add_row(octaves, photo, v->edge[t], y);
        rounded |= !photo->is_hdr;
    }
    float share = MAX_SHARE;
    for (int k = 0; k < NOISE_OCTAVES; k++) {
        struct octave *o = &octaves[k];
        size_t count = o->offered < SAMPLES ? (size_t)o->offered : SAMPLES;
        if (count >= MIN_SAMPLES) {
            float here = quantile(o->sample, count, QUANTILE) / (QUANTILE_DEVIATIONS * sqrtf(DIFFERENCE_VARIANCE));
            if (rounded)
                here = fmaxf(here, rounding_share(middle_of(k)));
            share = fminf(share, here);
        }
        noise->share[k] = share;
    }
    noise->black = rounded ? BLACK_DEVIATIONS * darkest_deviation(noise) : 0.0f;
    mem_free(octaves);
}

/* --- from place to place ------------------------------------------------------------------------ */

static uint32_t blocks(uint32_t pixels) { return (pixels + NOISE_BLOCK - 1) / NOISE_BLOCK; }

/* Squared median of the differences at a lag, over that expected from the octaves; 0 where there are too few. */
static float block_variance(const struct noise *noise, const struct photograph *photo, const uint8_t *edge, uint32_t x0,
                            uint32_t y0, uint32_t lag) {
    float ratio[3 * NOISE_BLOCK * NOISE_BLOCK];
    size_t count = 0;
    for (uint32_t y = y0; y < y0 + NOISE_BLOCK && y < photo->camera.height; y++) {
        for (uint32_t x = x0; x < x0 + NOISE_BLOCK && x < photo->camera.width; x++) {
            float mean[3], difference[3];
            int n = differences(photo, edge, x, y, lag, mean, difference);
            for (int i = 0; i < n; i++)
                ratio[count++] = difference[i] / noise->share[octave_of(mean[i])];
        }
    }
    if (count < MIN_DIFFERENCES)
        return 0.0f;
    float median = (float)QUANTILE_DEVIATIONS_PER_MAD * quantile(ratio, count, 0.5);
    return median * median / DIFFERENCE_VARIANCE;
}

static float *measure_blocks(const struct noise *noise, const struct photograph *photo, const uint8_t *edge) {
    uint32_t columns = blocks(photo->camera.width), rows = blocks(photo->camera.height);
    float *scale = mem_array((size_t)columns * rows, sizeof *scale);
    for (uint32_t row = 0; row < rows; row++) {
        for (uint32_t y = row * NOISE_BLOCK; y < (row + 1) * NOISE_BLOCK && y < photo->camera.height; y++)
            use_row(photo, edge, y);
        for (uint32_t column = 0; column < columns; column++) {
            uint32_t x = column * NOISE_BLOCK, y = row * NOISE_BLOCK;
            float near = block_variance(noise, photo, edge, x, y, 1);
            float far = block_variance(noise, photo, edge, x, y, 2);
            float nugget = far > near ? fmaxf(2.0f * near - far, 0.0f) : near;
            scale[row * columns + column] =
                near > 0.0f && far > 0.0f ? clampf(sqrtf(nugget), SCALE_MIN, SCALE_MAX) : 1.0f;
        }
    }
    return scale;
}

void noise_measure(struct noise *noise, const struct views *v) {
    *noise = (struct noise){.train_count = v->train_count};
    measure_shares(noise, v);
    noise->scale = mem_array(v->train_count, sizeof *noise->scale);
    for (size_t t = 0; t < v->train_count; t++)
        noise->scale[t] = measure_blocks(noise, &v->scene->photograph[v->train[t]], v->edge[t]);
}

void noise_set_black(const struct noise *noise, struct scene *scene) {
    for (size_t i = 0; i < scene->photograph_count; i++) {
        struct photograph *photo = &scene->photograph[i];
        photo->black = photo->is_test || photo->is_hdr ? 0.0f : noise->black;
    }
}

void noise_release(struct noise *noise) {
    for (size_t t = 0; t < noise->train_count; t++)
        mem_free(noise->scale[t]);
    mem_free(noise->scale);
    *noise = (struct noise){0};
}

/* --- deviation and weight of a look-up ---------------------------------------------------------- */

static float share_of(const struct noise *noise, const struct photograph *photo, float radiance, float gain) {
    return noise->share[octave_of(radiance * photo->exposure * gain)];
}

static rgb deviation_by_brightness(const struct noise *noise, const struct photograph *photo, rgb radiance) {
    return rgb_make(radiance.r * share_of(noise, photo, radiance.r, photo->gain.r),
                    radiance.g * share_of(noise, photo, radiance.g, photo->gain.g),
                    radiance.b * share_of(noise, photo, radiance.b, photo->gain.b));
}

static float scale_at(const struct noise *noise, uint32_t train, const struct camera *camera, float x, float y) {
    uint32_t column = (uint32_t)clampf(x, 0.0f, (float)(camera->width - 1)) / NOISE_BLOCK;
    uint32_t row = (uint32_t)clampf(y, 0.0f, (float)(camera->height - 1)) / NOISE_BLOCK;
    return noise->scale[train][row * blocks(camera->width) + column];
}

rgb noise_deviation(const struct noise *noise, const struct views *v, const struct view *view, rgb radiance) {
    const struct photograph *photo = &v->scene->photograph[v->train[view->train]];
    float scale = scale_at(noise, view->train, &photo->camera, view->x, view->y);
    return rgb_scale(deviation_by_brightness(noise, photo, radiance), scale);
}

float noise_deviation_of_value(const struct noise *noise, uint32_t train, const struct camera *camera, float x, float y,
                               float value) {
    return value * noise->share[octave_of(value)] * scale_at(noise, train, camera, x, y);
}

float noise_deviation_of_black(const struct noise *noise) { return noise->black / BLACK_DEVIATIONS; }

/* The inverse of the relative variance of a look-up with such a deviation where the true radiance is `radiance`. */
static float weight_of(rgb deviation, rgb radiance, float mixing) {
    float mean = rgb_mean(radiance);
    float share = mean > 0.0f ? fmaxf(rgb_mean(deviation) / mean, MIN_SHARE) : MAX_SHARE;
    return 1.0f / (share * share + mixing);
}

float noise_weight(const struct noise *noise, const struct views *v, const struct view *view, rgb radiance,
                   float mixing) {
    return weight_of(noise_deviation(noise, v, view, radiance), radiance, mixing);
}

float noise_weight_of_brightness(const struct noise *noise, const struct photograph *photo, rgb radiance) {
    return weight_of(deviation_by_brightness(noise, photo, radiance), radiance, 0.0f);
}

/* Plus or minus 1 with equal chances: as good as normal noise for second moments. */
static float sign_of(uint32_t train, long x, long y) {
    return rng_key(train, (uint64_t)x, (uint64_t)y) & 1 ? 1.0f : -1.0f;
}

float noise_draw(const struct view *view, bool cubic) {
    float x = view->x - 0.5f, y = view->y - 0.5f, sum = 0.0f;
    long column = (long)floorf(x), row = (long)floorf(y);
    float fx = x - (float)column, fy = y - (float)row;
    float wx[4] = {0.0f, 1.0f - fx, fx, 0.0f}, wy[4] = {0.0f, 1.0f - fy, fy, 0.0f};
    if (cubic) {
        photograph_cubic(fx, wx);
        photograph_cubic(fy, wy);
    }
    for (int k = 0; k < 16; k++) {
        float weight = wx[k % 4] * wy[k / 4];
        if (weight != 0.0f)
            sum += weight * sign_of(view->train, column - 1 + k % 4, row - 1 + k / 4);
    }
    return sum;
}
