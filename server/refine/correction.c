/* correction.c -- see correction.h. */
#include "server/refine/correction.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/scene/rgb_half.h"

/* Prior standard deviations of logarithms, by kind: of a cell's factor, and of its difference from a neighbour's. Light
 * may be off by 20 %, in tint by 3 %; along a line of cells the differences add up to that over 100 cells, in tint over
 * 25. */
static const double factor_deviation[CORRECTION_KINDS] = {0.2, 0.03};
static const double difference_deviation[CORRECTION_KINDS] = {0.02, 0.006};
/* Observations with the room's mean variance that are added to a cell's own, which are too few for a variance. */
#define ROOM_OBSERVATIONS 64.0f /* +25 %: +0.01 dB */
#define MAX_LOG_FACTOR 0.1f     /* bound of a logarithm; +25 %: 0 dB */
#define MIXED_WEIGHT 0.01f /* weight in a cell's light of a texel observed only in mixed pixels; +25 %: no change */
/* Lower bound of corrected base colour: no factor could raise 0 again. */
#define MIN_COLOR 0.002f /* +25 %: 0 dB */

/* --- cells -------------------------------------------------------------------------------------- */

static uint32_t cell_in(const struct correction *c, long column, long row, uint32_t chart) {
    if (column < 0 || row < 0 || column >= (long)c->columns || row >= (long)c->rows)
        return MARKOV_NONE;
    size_t block = (size_t)row * c->columns + (size_t)column;
    for (uint32_t k = c->first[block]; k < c->first[block + 1]; k++)
        if (c->chart[k] == chart)
            return k;
    return MARKOV_NONE;
}

static uint32_t cell_of(const struct correction *c, uint32_t texel) {
    uint32_t width = c->inverse->width;
    return cell_in(c, (long)(texel % width / c->spacing), (long)(texel / width / c->spacing),
                   c->chart_of_triangle[c->inverse->triangle[texel]]);
}

/* Appends the cells of the next block. */
static void add_cells(struct correction *c, size_t block, size_t *capacity) {
    const struct inverse_uv *inverse = c->inverse;
    uint32_t x0 = (uint32_t)(block % c->columns) * c->spacing, y0 = (uint32_t)(block / c->columns) * c->spacing;
    c->first[block] = c->first[block + 1] = (uint32_t)c->count;
    for (uint32_t y = y0; y < y0 + c->spacing && y < inverse->height; y++) {
        for (uint32_t x = x0; x < x0 + c->spacing && x < inverse->width; x++) {
            uint32_t triangle = inverse->triangle[(size_t)y * inverse->width + x];
            if (triangle == INVERSE_UV_NONE || cell_of(c, y * inverse->width + x) != MARKOV_NONE)
                continue;
            if (c->count == *capacity) {
                *capacity *= 2;
                c->chart = mem_realloc_array(c->chart, *capacity, sizeof *c->chart);
            }
            c->chart[c->count++] = c->chart_of_triangle[triangle];
            c->first[block + 1] = (uint32_t)c->count;
        }
    }
}

static void find_neighbours(struct correction *c, size_t block) {
    long column = (long)(block % c->columns), row = (long)(block / c->columns);
    for (uint32_t k = c->first[block]; k < c->first[block + 1]; k++) {
        c->neighbour[k][0] = cell_in(c, column - 1, row, c->chart[k]);
        c->neighbour[k][1] = cell_in(c, column + 1, row, c->chart[k]);
        c->neighbour[k][2] = cell_in(c, column, row - 1, c->chart[k]);
        c->neighbour[k][3] = cell_in(c, column, row + 1, c->chart[k]);
    }
}

void correction_init(struct correction *c, struct texture *base_color, const struct inverse_uv *inverse,
                     const uint32_t *chart_of_triangle, uint32_t spacing) {
    *c = (struct correction){.base_color = base_color,
                             .inverse = inverse,
                             .chart_of_triangle = chart_of_triangle,
                             .spacing = spacing,
                             .columns = (inverse->width + spacing - 1) / spacing,
                             .rows = (inverse->height + spacing - 1) / spacing};
    size_t blocks = (size_t)c->columns * c->rows, capacity = blocks;
    c->first = mem_calloc(blocks + 1, sizeof *c->first);
    c->chart = mem_array(capacity, sizeof *c->chart);
    for (size_t block = 0; block < blocks; block++)
        add_cells(c, block, &capacity);
    c->neighbour = mem_array(c->count + 1, sizeof *c->neighbour);
    for (size_t block = 0; block < blocks; block++)
        find_neighbours(c, block);
    markov_field_init(&c->field, c->count, (const uint32_t(*)[4])c->neighbour);
    c->sums = mem_calloc(c->count, sizeof *c->sums);
    c->solved = mem_calloc_large((size_t)inverse->width * inverse->height, sizeof *c->solved);
    c->light = mem_calloc(c->count, sizeof *c->light);
}

void correction_release(struct correction *c) {
    mem_free(c->first);
    mem_free(c->chart);
    mem_free(c->neighbour);
    markov_field_release(&c->field);
    mem_free(c->sums);
    mem_free(c->solved);
    mem_free(c->light);
    *c = (struct correction){0};
}

void correction_start(struct correction *c) {
    memset(c->sums, 0, c->count * sizeof *c->sums);
    for (size_t i = 0; i < c->inverse->valid_count; i++) {
        uint32_t texel = c->inverse->valid[i];
        const float *color = c->base_color->texel[texel];
        rgb_to_half(c->solved[texel], rgb_make(color[0], color[1], color[2]));
    }
}

void correction_set_light(struct correction *c, const struct fused *fused) {
    rgb *solved = mem_calloc(c->count, sizeof *solved), *observed = mem_calloc(c->count, sizeof *observed);
    for (size_t i = 0; i < c->inverse->valid_count; i++) {
        uint32_t texel = c->inverse->valid[i], cell = cell_of(c, texel);
        rgb radiance = fused_radiance(fused, texel);
        if (rgb_is_black(radiance))
            continue;
        float weight = fused->count[texel] > 0.0f ? 1.0f : MIXED_WEIGHT;
        solved[cell] = rgb_mad(solved[cell], weight, rgb_from_half(c->solved[texel]));
        observed[cell] = rgb_mad(observed[cell], weight, radiance);
    }
    for (size_t k = 0; k < c->count; k++) {
        rgb s = rgb_clamp(solved[k], MIN_COLOR * MIXED_WEIGHT, INFINITY);
        c->light[k] = rgb_make(observed[k].r / s.r, observed[k].g / s.g, observed[k].b / s.b);
    }
    mem_free(observed);
    mem_free(solved);
}

/* --- observations ------------------------------------------------------------------------------- */

rgb correction_expected(const struct correction *c, uint32_t texel) {
    return rgb_mul(c->light[cell_of(c, texel)], rgb_from_half(c->solved[texel]));
}

/* Weighted mean of the channels; 0 where all weights are 0. */
static float mean_by(const float value[3], const float weight[3]) {
    float sum = 0.0f, weights = 0.0f;
    for (int k = 0; k < 3; k++) {
        sum += weight[k] * value[k];
        weights += weight[k];
    }
    return weights > 0.0f ? sum / weights : 0.0f;
}

static float mean_of(const float value[3]) { return (value[0] + value[1] + value[2]) / 3.0f; }

void correction_add(struct correction *c, uint32_t texel, const struct comparison *comparison, float weight) {
    struct correction_sums *s = &c->sums[cell_of(c, texel)];
    float residual[3];
    for (int k = 0; k < 3; k++) {
        float channel_weight = weight * comparison->channel_weight[k];
        s->weight[k] += channel_weight;
        s->observed[k] += channel_weight * comparison->observed[k];
        s->rendered[k] += channel_weight * comparison->rendered[k] * expf(-s->factor[k]);
        residual[k] = comparison->observed[k] - comparison->rendered[k];
    }
    float gray = mean_by(residual, comparison->channel_weight);
    s->squared[CORRECTION_GRAY] += weight * mean_of(comparison->channel_weight) * gray * gray;
    for (int k = 0; k < 3; k++) {
        float tint = residual[k] - gray;
        s->squared[CORRECTION_TINT] += weight / 3.0f * comparison->channel_weight[k] * tint * tint;
    }
}

/* --- factors ------------------------------------------------------------------------------------ */

/* Mean squared residual of all observations. */
static void room_variance(const struct correction *c, float variance[CORRECTION_KINDS]) {
    double weight = 0.0, squared[CORRECTION_KINDS] = {0.0};
    for (size_t i = 0; i < c->count; i++) {
        weight += (double)mean_of(c->sums[i].weight);
        for (int kind = 0; kind < CORRECTION_KINDS; kind++)
            squared[kind] += (double)c->sums[i].squared[kind];
    }
    for (int kind = 0; kind < CORRECTION_KINDS; kind++)
        variance[kind] = weight > 0.0 ? (float)(squared[kind] / weight) : 0.0f;
}

/* Inverse variance of a cell's observed logarithm of one kind (and channel, of a tint). */
static float precision_of(const struct correction_sums *s, int kind, int channel, float room) {
    float weight = mean_of(s->weight);
    float variance = (s->squared[kind] + ROOM_OBSERVATIONS * room) / (weight + ROOM_OBSERVATIONS);
    return variance > 0.0f ? (kind == CORRECTION_GRAY ? weight : s->weight[channel]) / variance : 0.0f;
}

/* Logarithm of observed over rendered radiance, by channel; 0 where either is 0. */
static void log_ratios(const struct correction_sums *s, float log_ratio[3]) {
    for (int k = 0; k < 3; k++)
        log_ratio[k] = s->observed[k] > 0.0f && s->rendered[k] > 0.0f ? logf(s->observed[k] / s->rendered[k]) : 0.0f;
}

/* Logarithms by gray, and by the tints of the three channels: four fields. */
enum { FIELD_GRAY, FIELD_TINTS, FIELDS = FIELD_TINTS + 3 };

struct factor_job {
    const struct correction *correction;
    float room[CORRECTION_KINDS];
    double *value[FIELDS]; /* [count] what was observed, then the field; owned, both */
    double *precision[FIELDS];
};

static int kind_of(size_t field) { return field == FIELD_GRAY ? CORRECTION_GRAY : CORRECTION_TINT; }

static void observe(struct factor_job *job) {
    const struct correction *c = job->correction;
    for (size_t i = 0; i < c->count; i++) {
        float log_ratio[3];
        log_ratios(&c->sums[i], log_ratio);
        float gray = mean_by(log_ratio, c->sums[i].weight);
        for (size_t k = 0; k < FIELDS; k++) {
            int channel = k == FIELD_GRAY ? 0 : (int)k - FIELD_TINTS;
            job->precision[k][i] = (double)precision_of(&c->sums[i], kind_of(k), channel, job->room[kind_of(k)]);
            job->value[k][i] = (double)(k == FIELD_GRAY ? gray : log_ratio[channel] - gray);
        }
    }
}

/* One field on one part of the cells. */
static void solve_part(void *user, size_t index, int thread) {
    const struct factor_job *job = user;
    size_t k = index % FIELDS;
    double factor = factor_deviation[kind_of(k)], difference = difference_deviation[kind_of(k)];
    const struct markov_precision precision = {1.0 / (factor * factor), 1.0 / (difference * difference),
                                               job->precision[k]};
    (void)thread;
    markov_field_solve(&job->correction->field, index / FIELDS, &precision, job->value[k]);
}

static void find_factors(struct correction *c, struct parallel *pool) {
    struct factor_job job = {.correction = c};
    room_variance(c, job.room);
    for (size_t k = 0; k < FIELDS; k++) {
        job.value[k] = mem_array(c->count, sizeof *job.value[k]);
        job.precision[k] = mem_array(c->count, sizeof *job.precision[k]);
    }
    observe(&job);
    parallel_for(pool, c->field.part_count * FIELDS, solve_part, &job);
    for (size_t i = 0; i < c->count; i++)
        for (size_t k = 0; k < 3; k++)
            c->sums[i].factor[k] = clampf((float)job.value[FIELD_GRAY][i] + (float)job.value[FIELD_TINTS + k][i],
                                          -MAX_LOG_FACTOR, MAX_LOG_FACTOR);
    for (size_t k = 0; k < FIELDS; k++) {
        mem_free(job.precision[k]);
        mem_free(job.value[k]);
    }
}

/* --- texels ------------------------------------------------------------------------------------- */

/* Logarithms at a valid texel: bilinear between the centres of the cells of its chart. */
static void factor_at(const struct correction *c, uint32_t texel, float factor[3]) {
    uint32_t width = c->inverse->width, chart = c->chart_of_triangle[c->inverse->triangle[texel]];
    float x = ((float)(texel % width) + 0.5f) / (float)c->spacing - 0.5f;
    float y = ((float)(texel / width) + 0.5f) / (float)c->spacing - 0.5f;
    long column = (long)floorf(x), row = (long)floorf(y);
    float tx = x - (float)column, ty = y - (float)row, weights = 0.0f;
    factor[0] = factor[1] = factor[2] = 0.0f;
    for (int tap = 0; tap < 4; tap++) {
        uint32_t cell = cell_in(c, column + (tap & 1), row + (tap >> 1), chart);
        if (cell == MARKOV_NONE)
            continue;
        float weight = (tap & 1 ? tx : 1.0f - tx) * (tap & 2 ? ty : 1.0f - ty) + 1e-6f;
        for (int k = 0; k < 3; k++)
            factor[k] += weight * c->sums[cell].factor[k];
        weights += weight;
    }
    for (int k = 0; k < 3; k++)
        factor[k] /= weights;
}

static void apply_row(void *user, size_t row, int thread) {
    (void)thread;
    const struct correction *c = user;
    for (uint32_t x = 0; x < c->inverse->width; x++) {
        uint32_t texel = (uint32_t)row * c->inverse->width + x;
        if (c->inverse->triangle[texel] == INVERSE_UV_NONE)
            continue;
        float factor[3];
        factor_at(c, texel, factor);
        rgb solved = rgb_from_half(c->solved[texel]);
        const float from[3] = {solved.r, solved.g, solved.b};
        for (int k = 0; k < 3; k++)
            c->base_color->texel[texel][k] = clampf(from[k] * expf(factor[k]), MIN_COLOR, 1.0f);
    }
}

void correction_apply(struct correction *c, struct parallel *pool) {
    find_factors(c, pool);
    parallel_for(pool, c->inverse->height, apply_row, c);
}
