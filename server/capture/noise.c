/* noise.c -- see noise.h. */
#include "server/capture/noise.h"

#include <math.h>
#include <string.h>

#include "common/image.h"
#include "common/mem.h"
#include "common/quantile.h"
#include "common/rng.h"

#define MIN_EXPONENT (-24) /* first octave: from 2^-24, the smallest half */
/* Least number of differences of an octave: with fewer it takes the share of the octave below. The standard error of a
 * lower quartile of n half-normal values is 1.8 / sqrt(n) of it: 8 %. */
#define MIN_SAMPLES 512 /* +25 %: no change */
/* Differences are counted in buckets: 64 to an octave, from 2^-14, a tenth of a half's rounding, to above 3, the
 * largest that there is. */
#define BUCKET_BITS 6
#define BUCKET_OCTAVES 16
#define BUCKETS (BUCKET_OCTAVES << BUCKET_BITS)
#define BUCKET_LOWEST (-14)
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

/* How often differences occur, for each octave of the value: integers, so sums of them do not depend on their order. */
struct counts {
    uint64_t count[NOISE_OCTAVES][BUCKETS];
};

static int octave_of(float value) {
    int exponent = MIN_EXPONENT;
    if (value > 0.0f)
        frexpf(value, &exponent);
    int octave = exponent - MIN_EXPONENT;
    return octave < 0 ? 0 : octave >= NOISE_OCTAVES ? NOISE_OCTAVES - 1 : octave;
}

static float middle_of(int octave) { return ldexpf(0.75f, octave + MIN_EXPONENT); }

/* The first holds all that is smaller. */
static size_t bucket_of(float difference) {
    uint32_t bits, lowest = (uint32_t)(127 + BUCKET_LOWEST) << BUCKET_BITS;
    memcpy(&bits, &difference, sizeof bits);
    bits >>= 23 - BUCKET_BITS;
    return bits < lowest ? 0 : bits - lowest < BUCKETS ? bits - lowest : BUCKETS - 1;
}

/* Smallest difference of a bucket; that of the first counts as 0. */
static float bucket_start(size_t bucket) {
    uint32_t octave = (uint32_t)bucket >> BUCKET_BITS, part = (uint32_t)bucket & ((1u << BUCKET_BITS) - 1u);
    return bucket == 0 ? 0.0f : ldexpf(1.0f + ldexpf((float)part, -BUCKET_BITS), (int)octave + BUCKET_LOWEST);
}

/* Quantile of the counted differences, interpolated within its bucket; 0 in the first. */
static float counted_quantile(const uint64_t count[BUCKETS], uint64_t total, double share) {
    double at = share * (double)total, below = 0.0;
    size_t bucket = 0;
    while (bucket + 1 < BUCKETS && below + (double)count[bucket] <= at)
        below += (double)count[bucket++];
    if (bucket == 0)
        return 0.0f;
    float start = bucket_start(bucket), end = bucket_start(bucket + 1);
    return start + (float)((at - below) / (double)count[bucket]) * (end - start);
}

/* Deviation of rounding to 8-bit sRGB, as a share of the linear value: equal neighbouring pixels do not mean that there
 * is no noise. */
static float rounding_share(float value) {
    float slope = value < 0.0031308f ? 1.0f / 12.92f : 2.4f / 1.055f * powf(value, 1.4f / 2.4f);
    return slope / (255.0f * sqrtf(12.0f) * value);
}

/* A row's values; NAN where a pixel mixes surfaces, is masked or clipped. */
static void read_row(const struct photograph *photo, const uint8_t *edge, uint32_t y, float (*row)[3]) {
    size_t width = photo->camera.width, first = y * width;
    photograph_use(photo, first, width);
    spill_use(photo->spill, edge + first, width);
    for (size_t x = 0; x < width; x++) {
        size_t at = first + x;
        bool is_usable = edge[at] != VIEWS_EDGE && (!photo->mask || photo->mask[at]);
        for (int c = 0; c < 3; c++) {
            float value = is_usable ? image_float_from_half(photo->pixel[at][c]) : NAN;
            row[x][c] = value < photo->clip ? value : NAN;
        }
    }
}

/* Differences of pixel x of a row from the mean of those `lag` to its left and right, as shares of the mean of the
 * three, for each usable channel; returns how many. */
static int differences(float (*row)[3], uint32_t width, uint32_t x, uint32_t lag, float mean[3], float difference[3]) {
    int count = 0;
    if (x < lag || x + lag >= width)
        return 0;
    for (int c = 0; c < 3; c++) {
        float left = row[x - lag][c], middle = row[x][c], right = row[x + lag][c];
        float m = (left + middle + right) / 3.0f;
        if (!(m > 0.0f) || !isfinite(m))
            continue;
        mean[count] = m;
        difference[count++] = fabsf(middle - 0.5f * (left + right)) / m;
    }
    return count;
}

/* Deviation of the darkest 8-bit values that are not lost in noise. */
static float darkest_deviation(const struct noise *noise) {
    for (int k = 0; k < NOISE_OCTAVES; k++)
        if (noise->share[k] < LOST_SHARE * MAX_SHARE)
            return noise->share[k] * middle_of(k);
    return 0.0f;
}

struct noise_job {
    struct noise *noise;
    const struct views *views;
    struct counts *counts; /* [thread] */
};

static void count_photograph(void *user, size_t train, int thread) {
    const struct noise_job *job = user;
    const struct photograph *photo = &job->views->scene->photograph[job->views->train[train]];
    struct counts *counts = &job->counts[thread];
    uint32_t width = photo->camera.width;
    float(*row)[3] = mem_array(width, sizeof *row);
    for (uint32_t y = 0; y < photo->camera.height; y++) {
        read_row(photo, job->views->edge[train], y, row);
        for (uint32_t x = 0; x < width; x++) {
            float mean[3], difference[3];
            int count = differences(row, width, x, 1, mean, difference);
            for (int i = 0; i < count; i++)
                counts->count[octave_of(mean[i])][bucket_of(difference[i])]++;
        }
    }
    mem_free(row);
}

/* Adds up what the threads have counted, in the first one's place; returns the number of an octave's differences. */
static uint64_t merge_counts(struct counts *counts, int thread_count, int octave) {
    uint64_t total = 0;
    for (size_t k = 0; k < BUCKETS; k++) {
        for (int t = 1; t < thread_count; t++)
            counts->count[octave][k] += counts[t].count[octave][k];
        total += counts->count[octave][k];
    }
    return total;
}

static bool any_rounded(const struct views *v) {
    for (size_t t = 0; t < v->train_count; t++)
        if (!v->scene->photograph[v->train[t]].is_hdr)
            return true;
    return false;
}

static void measure_shares(struct noise *noise, const struct views *v, struct parallel *pool) {
    int threads = parallel_thread_count(pool);
    struct noise_job job = {noise, v, mem_calloc((size_t)threads, sizeof *job.counts)};
    bool rounded = any_rounded(v);
    float share = MAX_SHARE;
    parallel_for(pool, v->train_count, count_photograph, &job);
    for (int k = 0; k < NOISE_OCTAVES; k++) {
        uint64_t total = merge_counts(job.counts, threads, k);
        if (total >= MIN_SAMPLES) {
            float here = counted_quantile(job.counts->count[k], total, QUANTILE) /
                         (QUANTILE_DEVIATIONS * sqrtf(DIFFERENCE_VARIANCE));
            if (rounded)
                here = fmaxf(here, rounding_share(middle_of(k)));
            share = fminf(share, here);
        }
        noise->share[k] = share;
    }
    noise->black = rounded ? BLACK_DEVIATIONS * darkest_deviation(noise) : 0.0f;
    mem_free(job.counts);
}

/* --- from place to place ------------------------------------------------------------------------ */

static uint32_t blocks(uint32_t pixels) { return (pixels + NOISE_BLOCK - 1) / NOISE_BLOCK; }

/* Rows of a photograph that blocks are measured in, from their values (read_row). */
struct band {
    float (*value)[3]; /* [NOISE_BLOCK][width]; owned */
    uint32_t width, height;
};

/* Squared median of the differences at a lag in the band's block from column x0 on, over that expected from the
 * octaves; 0 where there are too few. */
static float block_variance(const struct noise *noise, const struct band *band, uint32_t x0, uint32_t lag) {
    float ratio[3 * NOISE_BLOCK * NOISE_BLOCK];
    size_t count = 0;
    for (uint32_t y = 0; y < band->height; y++) {
        for (uint32_t x = x0; x < x0 + NOISE_BLOCK && x < band->width; x++) {
            float mean[3], difference[3];
            int n = differences(band->value + (size_t)y * band->width, band->width, x, lag, mean, difference);
            for (int i = 0; i < n; i++)
                ratio[count++] = difference[i] / noise->share[octave_of(mean[i])];
        }
    }
    if (count < MIN_DIFFERENCES)
        return 0.0f;
    float median = (float)QUANTILE_DEVIATIONS_PER_MAD * quantile(ratio, count, 0.5);
    return median * median / DIFFERENCE_VARIANCE;
}

static float block_scale(const struct noise *noise, const struct band *band, uint32_t x0) {
    float near = block_variance(noise, band, x0, 1), far = block_variance(noise, band, x0, 2);
    float nugget = far > near ? fmaxf(2.0f * near - far, 0.0f) : near;
    return near > 0.0f && far > 0.0f ? clampf(sqrtf(nugget), SCALE_MIN, SCALE_MAX) : 1.0f;
}

static void measure_blocks(void *user, size_t train, int thread) {
    const struct noise_job *job = user;
    const struct photograph *photo = &job->views->scene->photograph[job->views->train[train]];
    uint32_t width = photo->camera.width, height = photo->camera.height;
    uint32_t columns = blocks(width), rows = blocks(height);
    float *scale = mem_array((size_t)columns * rows, sizeof *scale);
    struct band band = {mem_array((size_t)NOISE_BLOCK * width, sizeof *band.value), width, 0};
    (void)thread;
    for (uint32_t row = 0; row < rows; row++) {
        uint32_t first = row * NOISE_BLOCK;
        band.height = height - first < NOISE_BLOCK ? height - first : NOISE_BLOCK;
        for (uint32_t y = 0; y < band.height; y++)
            read_row(photo, job->views->edge[train], first + y, band.value + (size_t)y * width);
        for (uint32_t column = 0; column < columns; column++)
            scale[row * columns + column] = block_scale(job->noise, &band, column * NOISE_BLOCK);
    }
    job->noise->scale[train] = scale;
    mem_free(band.value);
}

void noise_measure(struct noise *noise, const struct views *v, struct parallel *pool) {
    *noise = (struct noise){.train_count = v->train_count};
    measure_shares(noise, v, pool);
    noise->scale = mem_array(v->train_count, sizeof *noise->scale);
    parallel_for(pool, v->train_count, measure_blocks, &(struct noise_job){noise, v, NULL});
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
