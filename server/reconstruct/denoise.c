/* denoise.c -- see denoise.h.
 *
 * A chart is filtered in tiles, each with a margin from which its filters read. Within a tile all
 * values are kept multiplied by their weights ("normalised convolution", Knutsson and Westin
 * 1993), so that a smoothing is a plain convolution of five planes, whatever is missing. */
#include "server/reconstruct/denoise.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"

#define LEVELS 5
#define TILE 512
/* Power is averaged over a square of this many steps of the level's filter to either side. */
#define WINDOW_STEPS 5
#define WINDOW_MAX 32
/* Noise of rare, far outliers has more power around a few texels than a draw of it tells. */
#define NOISE_SAFETY 1.5f
/* Beyond so many times the noise outliers are too many to be outliers. */
#define TEXTURE_CERTAIN 2.0f
#define POWER_BOUND 9.0f /* of a texel, in variances of its noise */
/* Reach of all filters together: 2 steps of each level, and the widest window. */
#define MARGIN (2 * ((1 << LEVELS) - 1) + WINDOW_MAX)

enum { RED, GREEN, BLUE, NOISE, MIXING = NOISE + 3, WEIGHT, PLANES };

struct box {
    long x0, y0, x1, y1; /* [x0, x1) x [y0, y1), texels of the atlas */
};

/* A part of a chart. */
struct item {
    uint32_t chart;
    struct box core, around; /* what is written; what is read */
};

/* The planes of one thread's tile. */
struct tile {
    size_t width, height;
    bool *inside;              /* [height][width] the texel belongs to the chart; owned, as all below */
    float *fine[PLANES];       /* premultiplied by the weight, but for the weight itself */
    float *coarse[PLANES];
    float *total[3];           /* what was kept so far */
    float *power, *bounded_power, *noise_power, *weight_sum, *count; /* window sums */
    float *scratch;
};

struct denoise_job {
    const struct atlas *atlas;
    const struct inverse_uv *inverse;
    const struct measured *measured;
    const struct color_prior *prior;
    struct texture *out;
    struct item *item;
    struct tile *tile; /* [threads] */
};

/* --- tiles -------------------------------------------------------------------------------------- */

static void tile_init(struct tile *t) {
    const size_t most = (size_t)(TILE + 2 * MARGIN) * (TILE + 2 * MARGIN);
    t->inside = mem_array(most, sizeof *t->inside);
    for (int p = 0; p < PLANES; p++) {
        t->fine[p] = mem_array(most, sizeof(float));
        t->coarse[p] = mem_array(most, sizeof(float));
    }
    for (int c = 0; c < 3; c++)
        t->total[c] = mem_array(most, sizeof(float));
    float **plane[] = {&t->power, &t->bounded_power, &t->noise_power, &t->weight_sum, &t->count, &t->scratch};
    for (size_t i = 0; i < sizeof plane / sizeof *plane; i++)
        *plane[i] = mem_array(most, sizeof(float));
}

static void tile_release(struct tile *t) {
    mem_free(t->inside);
    for (int p = 0; p < PLANES; p++) {
        mem_free(t->fine[p]);
        mem_free(t->coarse[p]);
    }
    for (int c = 0; c < 3; c++)
        mem_free(t->total[c]);
    float *plane[] = {t->power, t->bounded_power, t->noise_power, t->weight_sum, t->count, t->scratch};
    for (size_t i = 0; i < sizeof plane / sizeof *plane; i++)
        mem_free(plane[i]);
}

static void tile_read(struct tile *t, const struct denoise_job *job, const struct item *item) {
    const struct box *b = &item->around;
    t->width = (size_t)(b->x1 - b->x0);
    t->height = (size_t)(b->y1 - b->y0);
    size_t at = 0;
    for (long y = b->y0; y < b->y1; y++) {
        for (long x = b->x0; x < b->x1; x++, at++) {
            size_t texel = (size_t)y * job->inverse->width + (size_t)x;
            uint32_t triangle = job->inverse->triangle[texel];
            t->inside[at] = triangle != INVERSE_UV_NONE && job->atlas->chart_of_triangle[triangle] == item->chart;
            struct measured m = {0};
            if (t->inside[at])
                m = job->measured[texel];
            rgb value = measured_value(&m);
            const float plane[PLANES] = {value.r, value.g, value.b,
                                         image_float_from_half(m.noise[0]), image_float_from_half(m.noise[1]),
                                         image_float_from_half(m.noise[2]), image_float_from_half(m.mixing), 1.0f};
            for (int p = 0; p < PLANES; p++)
                t->fine[p][at] = m.weight * plane[p];
            for (int c = 0; c < 3; c++)
                t->total[c][at] = 0.0f;
        }
    }
}

static void tile_write(const struct tile *t, const struct denoise_job *job, const struct item *item) {
    for (long y = item->core.y0; y < item->core.y1; y++) {
        for (long x = item->core.x0; x < item->core.x1; x++) {
            size_t texel = (size_t)y * job->inverse->width + (size_t)x;
            size_t at = (size_t)(y - item->around.y0) * t->width + (size_t)(x - item->around.x0);
            for (int c = 0; c < 3 && t->inside[at]; c++)
                job->out->texel[texel][c] = clampf(t->total[c][at], 0.0f, 1.0f);
        }
    }
}

/* --- filters ------------------------------------------------------------------------------------ */

/* One row or column of the B3 spline at `step` texels between taps; `to` is not `from`. */
static void spline_rows(float *to, const float *from, size_t width, size_t height, size_t step) {
    static const float tap[5] = {1.0f / 16.0f, 4.0f / 16.0f, 6.0f / 16.0f, 4.0f / 16.0f, 1.0f / 16.0f};
    for (size_t y = 0; y < height; y++) {
        const float *in = from + y * width;
        float *out = to + y * width;
        memset(out, 0, width * sizeof *out);
        for (long k = -2; k <= 2; k++) {
            long shift = k * (long)step;
            size_t first = shift < 0 ? (size_t)-shift : 0;
            size_t end = shift > 0 ? (width > (size_t)shift ? width - (size_t)shift : 0) : width;
            for (size_t x = first; x < end; x++)
                out[x] += tap[k + 2] * in[(long)x + shift];
        }
    }
}

static void spline_columns(float *to, const float *from, size_t width, size_t height, size_t step) {
    static const float tap[5] = {1.0f / 16.0f, 4.0f / 16.0f, 6.0f / 16.0f, 4.0f / 16.0f, 1.0f / 16.0f};
    for (size_t y = 0; y < height; y++) {
        float *out = to + y * width;
        memset(out, 0, width * sizeof *out);
        for (long k = -2; k <= 2; k++) {
            long row = (long)y + k * (long)step;
            if (row < 0 || row >= (long)height)
                continue;
            const float *in = from + (size_t)row * width;
            for (size_t x = 0; x < width; x++)
                out[x] += tap[k + 2] * in[x];
        }
    }
}

/* Sums over the square of `radius` texels around each; in place. */
static void window_sums(float *plane, float *scratch, size_t width, size_t height, size_t radius) {
    for (size_t y = 0; y < height; y++) {
        const float *in = plane + y * width;
        double sum = 0.0;
        for (size_t x = 0; x < radius && x < width; x++)
            sum += (double)in[x];
        for (size_t x = 0; x < width; x++) {
            sum += x + radius < width ? (double)in[x + radius] : 0.0;
            scratch[y * width + x] = (float)sum;
            sum -= x >= radius ? (double)in[x - radius] : 0.0;
        }
    }
    for (size_t x = 0; x < width; x++) {
        double sum = 0.0;
        for (size_t y = 0; y < radius && y < height; y++)
            sum += (double)scratch[y * width + x];
        for (size_t y = 0; y < height; y++) {
            sum += y + radius < height ? (double)scratch[(y + radius) * width + x] : 0.0;
            plane[y * width + x] = (float)sum;
            sum -= y >= radius ? (double)scratch[(y - radius) * width + x] : 0.0;
        }
    }
}

/* --- the filter --------------------------------------------------------------------------------- */

static float detail(const struct tile *t, int plane, size_t at) {
    return t->fine[plane][at] / t->fine[WEIGHT][at] - t->coarse[plane][at] / t->coarse[WEIGHT][at];
}

/* Of the three planes from `first` on. */
static float detail_power(const struct tile *t, int first, size_t at) {
    float power = 0.0f;
    for (int p = first; p < first + 3; p++)
        power += detail(t, p, at) * detail(t, p, at);
    return power;
}

static bool counts(const struct tile *t, size_t at) {
    return t->inside[at] && t->fine[WEIGHT][at] > 0.0f;
}

/* Variance of the noise of a texel's detail: what the draws around it tell, by its own weight. */
static float noise_variance(const struct tile *t, size_t at) {
    return t->noise_power[at] / (t->count[at] * t->fine[WEIGHT][at]);
}

/* Power of the noise around each texel, and what it is to be divided by. */
static void measure_noise(struct tile *t, size_t radius) {
    size_t texels = t->width * t->height;
    for (size_t at = 0; at < texels; at++) {
        float weight = counts(t, at) ? t->fine[WEIGHT][at] : 0.0f;
        t->noise_power[at] = weight > 0.0f ? weight * detail_power(t, NOISE, at) : 0.0f;
        t->weight_sum[at] = weight;
        t->count[at] = weight > 0.0f ? 1.0f : 0.0f;
    }
    float *plane[] = {t->noise_power, t->weight_sum, t->count};
    for (size_t i = 0; i < sizeof plane / sizeof *plane; i++)
        window_sums(plane[i], t->scratch, t->width, t->height, radius);
}

/* Power of what is seen around each texel: all of it, and with that of each texel bounded. */
static void measure_power(struct tile *t, size_t radius) {
    size_t texels = t->width * t->height;
    for (size_t at = 0; at < texels; at++) {
        float power = 0.0f, bound = 0.0f;
        if (counts(t, at)) {
            power = detail_power(t, RED, at);
            bound = POWER_BOUND * noise_variance(t, at);
        }
        t->power[at] = t->fine[WEIGHT][at] * power;
        t->bounded_power[at] = t->fine[WEIGHT][at] * fminf(power, bound);
    }
    window_sums(t->power, t->scratch, t->width, t->height, radius);
    window_sums(t->bounded_power, t->scratch, t->width, t->height, radius);
}

/* Power of texture around a texel: what is beyond noise; of outliers only up to their bound, unless there
 * are so many that they are no outliers. */
static float texture_power(const struct tile *t, size_t at) {
    float noise = t->noise_power[at], bounded = t->bounded_power[at];
    float power = bounded < TEXTURE_CERTAIN * noise ? bounded : t->power[at];
    return fmaxf(power - NOISE_SAFETY * noise, 0.0f) / t->weight_sum[at];
}

/* Adds the share of this level's detail that is texture. */
static void keep_texture(struct tile *t) {
    size_t texels = t->width * t->height;
    for (size_t at = 0; at < texels; at++) {
        if (!counts(t, at))
            continue;
        float texture = texture_power(t, at);
        float noise = noise_variance(t, at) + t->fine[MIXING][at] / t->fine[WEIGHT][at];
        float keep = texture > 0.0f ? texture / (texture + noise) : 0.0f;
        for (int c = RED; c <= BLUE; c++)
            t->total[c][at] += keep * detail(t, c, at);
    }
}

static void filter_tile(struct tile *t) {
    for (int level = 0; level < LEVELS; level++) {
        size_t step = (size_t)1 << level;
        for (int p = 0; p < PLANES; p++) {
            spline_rows(t->scratch, t->fine[p], t->width, t->height, step);
            spline_columns(t->coarse[p], t->scratch, t->width, t->height, step);
        }
        size_t radius = WINDOW_STEPS * step < WINDOW_MAX ? WINDOW_STEPS * step : WINDOW_MAX;
        measure_noise(t, radius);
        measure_power(t, radius);
        keep_texture(t);
        for (int p = 0; p < PLANES; p++) {
            float *was = t->fine[p];
            t->fine[p] = t->coarse[p];
            t->coarse[p] = was;
        }
    }
}

/* Adds what no level's detail tells: the smoothest of the levels, drawn to the prior where it may be
 * light of other surfaces. */
static void add_mean(struct tile *t, const struct color_prior *prior) {
    const float mean[3] = {prior->mean.r, prior->mean.g, prior->mean.b};
    size_t texels = t->width * t->height;
    for (size_t at = 0; at < texels; at++) {
        float weight = t->fine[WEIGHT][at];
        float keep = weight > 0.0f ? prior->variance / (prior->variance + t->fine[MIXING][at] / weight) : 0.0f;
        for (int c = RED; c <= BLUE; c++)
            t->total[c][at] += mean[c] + (keep > 0.0f ? keep * (t->fine[c][at] / weight - mean[c]) : 0.0f);
    }
}

static void denoise_item(void *user, size_t index, int thread) {
    const struct denoise_job *job = user;
    struct tile *t = &job->tile[thread];
    const struct item *item = &job->item[index];
    tile_read(t, job, item);
    filter_tile(t);
    add_mean(t, &job->prior[item->chart]);
    tile_write(t, job, item);
}

/* --- which tiles there are ---------------------------------------------------------------------- */

/* The texels that each chart covers, and one more all around. */
static struct box *chart_boxes(const struct atlas *atlas, size_t triangle_count) {
    struct box *box = mem_array(atlas->chart_count, sizeof *box);
    for (size_t i = 0; i < atlas->chart_count; i++)
        box[i] = (struct box){(long)atlas->width, (long)atlas->height, 0, 0};
    for (size_t i = 0; i < triangle_count; i++) {
        struct box *b = &box[atlas->chart_of_triangle[i]];
        for (int k = 0; k < 3; k++) {
            long x = (long)floorf(atlas->corner[i][k].x), y = (long)floorf(atlas->corner[i][k].y);
            *b = (struct box){x - 1 < b->x0 ? x - 1 : b->x0, y - 1 < b->y0 ? y - 1 : b->y0,
                              x + 2 > b->x1 ? x + 2 : b->x1, y + 2 > b->y1 ? y + 2 : b->y1};
        }
    }
    return box;
}

static struct box common(struct box a, struct box b) {
    return (struct box){a.x0 > b.x0 ? a.x0 : b.x0, a.y0 > b.y0 ? a.y0 : b.y0, a.x1 < b.x1 ? a.x1 : b.x1,
                        a.y1 < b.y1 ? a.y1 : b.y1};
}

/* The parts of all charts that are wanted; item may be NULL to count them. */
static size_t list_items(const struct atlas *atlas, const struct box *chart, const bool *wanted, struct item *item) {
    const struct box whole = {0, 0, (long)atlas->width, (long)atlas->height};
    size_t count = 0;
    for (size_t i = 0; i < atlas->chart_count; i++) {
        if (wanted && !wanted[i])
            continue;
        struct box own = common(chart[i], whole);
        for (long y = own.y0; y < own.y1; y += TILE) {
            for (long x = own.x0; x < own.x1; x += TILE, count++) {
                struct box around = {x - MARGIN, y - MARGIN, x + TILE + MARGIN, y + TILE + MARGIN};
                if (item)
                    item[count] = (struct item){(uint32_t)i, common((struct box){x, y, x + TILE, y + TILE}, own),
                                                common(around, own)};
            }
        }
    }
    return count;
}

void denoise(const struct atlas *atlas, const struct inverse_uv *inverse, size_t triangle_count,
             const struct measured *measured, const struct color_prior *prior, const bool *wanted,
             struct texture *out, struct parallel *pool) {
    struct denoise_job job = {atlas, inverse, measured, prior, out, NULL, NULL};
    size_t threads = (size_t)parallel_thread_count(pool);
    struct box *chart = chart_boxes(atlas, triangle_count);
    size_t count = list_items(atlas, chart, wanted, NULL);
    job.item = mem_array(count + 1, sizeof *job.item);
    list_items(atlas, chart, wanted, job.item);
    job.tile = mem_array(threads, sizeof *job.tile);
    for (size_t i = 0; i < threads; i++)
        tile_init(&job.tile[i]);
    parallel_for(pool, count, denoise_item, &job);
    for (size_t i = 0; i < threads; i++)
        tile_release(&job.tile[i]);
    mem_free(job.tile);
    mem_free(job.item);
    mem_free(chart);
}
