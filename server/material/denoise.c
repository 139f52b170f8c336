/* denoise.c -- see denoise.h.
 *
 * The finest band of a chart's scales is filtered in tiles with a margin for the filters. The low-pass that it
 * leaves is sampled at every GRID-th texel a side, and the coarser bands of the whole chart are filtered on that
 * grid. */
#include "server/material/denoise.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/material/patch_transform.h"
#include "server/material/texture_variance.h"
#include "server/material/wiener.h"

#define TILE 512      /* texels a side; does not change results */
#define FINE_STEP 1   /* texels: of the first band, filtered by tiles; the rest on the grid */
#define GRID 4        /* texels between samples of the coarse scales: a quarter of their finest octave's step */
#define COARSE_STEP 2 /* samples of the grid: step of the first coarse band */

enum { SMOOTH_ERROR = 3, SMOOTH };

struct box {
    long x0, y0, x1, y1; /* [x0, x1) x [y0, y1), texels of the atlas */
};

/* The coarse scales of a chart: at texels x0 + GRID * i, y0 + GRID * j of the atlas. */
struct layer {
    struct box box;              /* a whole number of grid steps, one more than the chart covers; empty: not wanted */
    size_t width, height;        /* of the grid */
    float *plane[WIENER_PLANES]; /* [height][width] low-pass of the fine scales; owned */
    float (*smooth)[SMOOTH];     /* [height][width] the same, denoised, and its squared error over channels; owned */
};

/* A part of a chart. */
struct item {
    uint32_t chart;
    struct box core, around; /* texels written; texels read */
};

struct denoise_job {
    const struct atlas *atlas;
    const struct inverse_uv *inverse;
    const struct measurement *measured;
    const struct color_prior *prior;
    struct texture *out;
    uint32_t stride;
    uint16_t *deviation;               /* NULL: not wanted; meanwhile squared errors of the fine scales */
    struct texture_variance *variance; /* [chart_count] */
    struct layer *layer;               /* [chart_count] */
    struct item *item;
    struct wiener *tile; /* [threads] */
};

/* Whether a place is a texel of the chart. */
static bool is_inside(const struct denoise_job *job, uint32_t chart, long x, long y) {
    if (x < 0 || y < 0 || x >= (long)job->inverse->width || y >= (long)job->inverse->height)
        return false;
    uint32_t triangle = job->inverse->triangle[(size_t)y * job->inverse->width + (size_t)x];
    return triangle != INVERSE_UV_NONE && job->atlas->chart_of_triangle[triangle] == chart;
}

/* --- fine scales -------------------------------------------------------------------------------- */

static void tile_read(struct wiener *t, const struct denoise_job *job, const struct item *item) {
    const struct box *b = &item->around;
    t->width = (size_t)(b->x1 - b->x0);
    t->height = (size_t)(b->y1 - b->y0);
    size_t at = 0;
    for (long y = b->y0; y < b->y1; y++) {
        for (long x = b->x0; x < b->x1; x++, at++) {
            struct measurement m = {0};
            t->inside[at] = is_inside(job, item->chart, x, y);
            if (t->inside[at])
                m = job->measured[(size_t)y * job->inverse->width + (size_t)x];
            const struct texture_variance *of = &job->variance[item->chart];
            bool is_measured = m.weight > 0.0f;
            float mixing = image_float_from_half(m.mixing);
            float weight = is_measured ? texture_variance_weight(of, m.weight, mixing) : 0.0f;
            float variance = is_measured ? texture_variance_noise(of, m.weight) : 0.0f;
            rgb value = measurement_value(&m);
            rgb noise = rgb_from_half(m.noise);
            const float plane[WIENER_PLANES] = {value.r, value.g, value.b,  noise.r, noise.g,
                                                noise.b, mixing,  variance, 1.0f};
            for (int p = 0; p < WIENER_PLANES; p++)
                t->plane[p][at] = weight * plane[p];
            for (int c = 0; c < 3; c++)
                t->kept[c][at] = 0.0f;
            t->error[at] = 0.0f;
        }
    }
}

/* Writes the fine scales to the texture, and their low-pass to the layer. */
static void tile_write(const struct wiener *t, const struct denoise_job *job, const struct item *item) {
    const struct layer *layer = &job->layer[item->chart];
    for (long y = item->core.y0; y < item->core.y1; y++) {
        for (long x = item->core.x0; x < item->core.x1; x++) {
            size_t at = (size_t)(y - item->around.y0) * t->width + (size_t)(x - item->around.x0);
            for (int c = 0; c < 3 && t->inside[at]; c++)
                job->out->texel[(size_t)y * job->inverse->width + (size_t)x][c] = t->kept[c][at];
            if (t->inside[at] && job->deviation)
                job->deviation[(size_t)y * job->inverse->width + (size_t)x] =
                    image_half_from_float(sqrtf(t->error[at]));
            long i = x - layer->box.x0, j = y - layer->box.y0;
            if (i % GRID != 0 || j % GRID != 0)
                continue;
            for (int p = 0; p < WIENER_PLANES; p++)
                layer->plane[p][(size_t)(j / GRID) * layer->width + (size_t)(i / GRID)] = t->plane[p][at];
        }
    }
}

static void filter_fine(void *user, size_t index, int thread) {
    const struct denoise_job *job = user;
    struct wiener *t = &job->tile[thread];
    tile_read(t, job, &job->item[index]);
    wiener_band(t, FINE_STEP, WIENER_OCTAVES, job->stride);
    tile_write(t, job, &job->item[index]);
}

/* --- coarse scales ------------------------------------------------------------------------------ */

static void layer_init(struct layer *l, struct box box) {
    *l = (struct layer){
        .box = box, .width = (size_t)((box.x1 - box.x0) / GRID + 1), .height = (size_t)((box.y1 - box.y0) / GRID + 1)};
    for (int p = 0; p < WIENER_PLANES; p++)
        l->plane[p] = mem_array(l->width * l->height, sizeof(float));
    l->smooth = mem_array(l->width * l->height, sizeof *l->smooth);
}

static void layer_release(struct layer *l) {
    for (int p = 0; p < WIENER_PLANES; p++)
        mem_free(l->plane[p]);
    mem_free(l->smooth);
}

/* Bands until a step is as long as the layer. */
static void filter_bands(struct wiener *w, size_t side, size_t resolution) {
    for (size_t step = COARSE_STEP; step < side; step <<= WIENER_OCTAVES) {
        int octaves = 1;
        while (octaves < WIENER_OCTAVES && step << octaves < side)
            octaves++;
        wiener_band(w, step, octaves, resolution);
    }
}

/* Sum of the scales kept and of the final low-pass, which is shrunk to the prior by the variance from light of other
 * surfaces. */
static void add_mean(float smooth[SMOOTH], const struct wiener *w, size_t at, const struct color_prior *prior) {
    const float mean[3] = {prior->mean.r, prior->mean.g, prior->mean.b};
    float weight = w->plane[WIENER_WEIGHT][at];
    float known = weight > 0.0f ? prior->variance / (prior->variance + w->plane[WIENER_MIXING][at] / weight) : 0.0f;
    float error = w->error[at] + (1.0f - known) * prior->variance; /* known of mixing is the same */
    for (int c = 0; c < 3; c++) {
        float measured = known > 0.0f ? w->plane[WIENER_VALUE + c][at] / weight : mean[c];
        smooth[c] = w->kept[c][at] + mean[c] + known * (measured - mean[c]);
        float noise = known > 0.0f ? known * w->plane[WIENER_NOISE + c][at] / weight : 0.0f;
        error += noise * noise;
    }
    smooth[SMOOTH_ERROR] = error;
}

static void filter_coarse(void *user, size_t chart, int thread) {
    (void)thread;
    const struct denoise_job *job = user;
    struct layer *l = &job->layer[chart];
    if (!l->smooth)
        return;
    size_t samples = l->width * l->height;
    struct wiener w;
    wiener_init(&w, samples);
    w.width = l->width;
    w.height = l->height;
    for (int p = 0; p < WIENER_PLANES; p++)
        memcpy(w.plane[p], l->plane[p], samples * sizeof *w.plane[p]);
    for (int c = 0; c < 3; c++)
        memset(w.kept[c], 0, samples * sizeof *w.kept[c]);
    memset(w.error, 0, samples * sizeof *w.error);
    for (size_t i = 0; i < samples; i++)
        w.inside[i] = true;
    filter_bands(&w, l->width > l->height ? l->width : l->height, job->stride / GRID);
    for (size_t i = 0; i < samples; i++)
        add_mean(l->smooth[i], &w, i, &job->prior[chart]);
    wiener_release(&w);
}

/* Bilinear; a layer has one sample beyond the last texel. */
static float smooth_at(const struct layer *l, long x, long y, int channel) {
    long i = (x - l->box.x0) / GRID, j = (y - l->box.y0) / GRID;
    float tx = (float)((x - l->box.x0) % GRID) / GRID, ty = (float)((y - l->box.y0) % GRID) / GRID;
    const float(*at)[SMOOTH] = l->smooth + (size_t)j * l->width + i, (*below)[SMOOTH] = at + l->width;
    return (1.0f - ty) * ((1.0f - tx) * at[0][channel] + tx * at[1][channel]) +
           ty * ((1.0f - tx) * below[0][channel] + tx * below[1][channel]);
}

/* The standard deviation of a texel, over channels. Detail of one that was not measured is that of its chart. */
static void add_error(const struct denoise_job *job, const struct item *item, long x, long y) {
    size_t texel = (size_t)y * job->inverse->width + (size_t)x;
    float fine = image_float_from_half(job->deviation[texel]);
    float variance = fine * fine + smooth_at(&job->layer[item->chart], x, y, SMOOTH_ERROR);
    if (!(job->measured[texel].weight > 0.0f))
        variance = fmaxf(variance, job->prior[item->chart].variance);
    job->deviation[texel] = image_half_from_float(sqrtf(variance / 3.0f));
}

static void add_coarse(void *user, size_t index, int thread) {
    (void)thread;
    const struct denoise_job *job = user;
    const struct item *item = &job->item[index];
    const struct layer *layer = &job->layer[item->chart];
    for (long y = item->core.y0; y < item->core.y1; y++) {
        for (long x = item->core.x0; x < item->core.x1; x++) {
            if (!is_inside(job, item->chart, x, y))
                continue;
            float *texel = job->out->texel[(size_t)y * job->inverse->width + (size_t)x];
            for (int c = 0; c < 3; c++)
                texel[c] = clampf(texel[c] + smooth_at(layer, x, y, c), 0.0f, 1.0f);
            if (job->deviation)
                add_error(job, item, x, y);
        }
    }
}

/* --- which tiles there are ---------------------------------------------------------------------- */

/* Bounding box of each chart, with a margin of one texel. */
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

/* Box of the layer of a chart with bounding box b: whole grid steps, and one more. */
static struct box layer_box(const struct box *b) {
    return (struct box){b->x0, b->y0, b->x0 + ((b->x1 - 1 - b->x0) / GRID + 1) * GRID + 1,
                        b->y0 + ((b->y1 - 1 - b->y0) / GRID + 1) * GRID + 1};
}

static void make_layers(struct denoise_job *job, size_t triangle_count, const bool *wanted) {
    const struct box whole = {0, 0, (long)job->atlas->width, (long)job->atlas->height};
    struct box *chart = chart_boxes(job->atlas, triangle_count);
    job->layer = mem_calloc(job->atlas->chart_count, sizeof *job->layer);
    for (size_t i = 0; i < job->atlas->chart_count; i++) {
        struct box own = common(chart[i], whole);
        if ((!wanted || wanted[i]) && own.x0 < own.x1 && own.y0 < own.y1)
            layer_init(&job->layer[i], layer_box(&own));
    }
    mem_free(chart);
}

/* What a tile's filters read beyond it: whole shifts of a patch, so that patches lie the same in all tiles. */
static size_t tile_margin(void) { return (wiener_reach(FINE_STEP) + PATCH_SHIFT - 1) / PATCH_SHIFT * PATCH_SHIFT; }

/* The tiles of all layers; item may be NULL to count them. */
static size_t list_items(const struct denoise_job *job, struct item *item) {
    const long margin = (long)tile_margin();
    size_t count = 0;
    for (size_t i = 0; i < job->atlas->chart_count; i++) {
        struct box own = job->layer[i].box;
        for (long y = own.y0; y < own.y1; y += TILE) {
            for (long x = own.x0; x < own.x1; x += TILE, count++) {
                struct box core = {x, y, x + TILE, y + TILE};
                struct box around = {x - margin, y - margin, core.x1 + margin, core.y1 + margin};
                if (item)
                    item[count] = (struct item){(uint32_t)i, common(core, own), common(around, own)};
            }
        }
    }
    return count;
}

void denoise(const struct atlas *atlas, const struct inverse_uv *inverse, size_t triangle_count,
             const struct measurement *measured, const struct color_prior *prior, const bool *wanted,
             struct texture *out, uint32_t stride, uint16_t *deviation, struct parallel *pool) {
    struct denoise_job job = {.atlas = atlas,
                              .inverse = inverse,
                              .measured = measured,
                              .prior = prior,
                              .out = out,
                              .stride = stride,
                              .deviation = deviation};
    const size_t threads = (size_t)parallel_thread_count(pool);
    const size_t side = TILE + 2 * tile_margin();
    job.variance = texture_variances(atlas, inverse, measured);
    make_layers(&job, triangle_count, wanted);
    size_t count = list_items(&job, NULL);
    job.item = mem_array(count + 1, sizeof *job.item);
    list_items(&job, job.item);
    job.tile = mem_array(threads, sizeof *job.tile);
    for (size_t i = 0; i < threads; i++)
        wiener_init(&job.tile[i], side * side);
    parallel_for(pool, count, filter_fine, &job);
    for (size_t i = 0; i < threads; i++)
        wiener_release(&job.tile[i]);
    mem_free(job.tile);
    parallel_for(pool, atlas->chart_count, filter_coarse, &job);
    parallel_for(pool, count, add_coarse, &job);
    for (size_t i = 0; i < atlas->chart_count; i++)
        layer_release(&job.layer[i]);
    mem_free(job.layer);
    mem_free(job.variance);
    mem_free(job.item);
}
