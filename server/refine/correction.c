/* correction.c -- see correction.h. */
#include "server/refine/correction.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/capture/conjugate.h"
#include "server/scene/rgb_half.h"

#define NONE UINT32_MAX
/* Standard deviations of logarithms: of a cell's factor, and of its difference from that of the cell beside it. The
 * first are wide, since what the cells of a chart are off by they share. */
static const double about_one[CORRECTION_KINDS] = {0.2, 0.03}, about_beside[CORRECTION_KINDS] = {0.02, 0.006};
/* So many looks of the whole room's noise are added to those of a cell, whose own tell little of theirs. */
#define ROOM_LOOKS 64.0f
/* A logarithm is moved by so much at most. */
#define MOST_MOVED 0.1f
/* Conjugate gradients end when the residual has this part of its square, or after so many steps: the looser the hold
 * on 1, the further what a chart's cells share has to travel. */
#define RESIDUAL_PART 1e-8
#define STEPS_MOST 2000
/* What a texel counts that photographs show only in pixels with other surfaces, when the light of its cell is told. */
#define UNCLEAN 0.01f
/* No factor takes a texel below this: from 0 none would bring it back. */
#define LEAST_COLOR 0.002f

/* --- cells -------------------------------------------------------------------------------------- */

static uint32_t cell_in(const struct correction *c, long column, long row, uint32_t chart) {
    if (column < 0 || row < 0 || column >= (long)c->columns || row >= (long)c->rows)
        return NONE;
    size_t block = (size_t)row * c->columns + (size_t)column;
    for (uint32_t k = c->first[block]; k < c->first[block + 1]; k++)
        if (c->cell[k].chart == chart)
            return k;
    return NONE;
}

static uint32_t cell_of(const struct correction *c, uint32_t texel) {
    uint32_t width = c->inverse->width;
    return cell_in(c, (long)(texel % width / c->spacing), (long)(texel / width / c->spacing),
                   c->chart_of_triangle[c->inverse->triangle[texel]]);
}

/* Adds the cells of a block, which is the last so far. */
static void add_cells(struct correction *c, size_t block, size_t *capacity) {
    const struct inverse_uv *inverse = c->inverse;
    uint32_t x0 = (uint32_t)(block % c->columns) * c->spacing, y0 = (uint32_t)(block / c->columns) * c->spacing;
    c->first[block] = c->first[block + 1] = (uint32_t)c->count;
    for (uint32_t y = y0; y < y0 + c->spacing && y < inverse->height; y++) {
        for (uint32_t x = x0; x < x0 + c->spacing && x < inverse->width; x++) {
            uint32_t triangle = inverse->triangle[(size_t)y * inverse->width + x];
            if (triangle == INVERSE_UV_NONE || cell_of(c, y * inverse->width + x) != NONE)
                continue;
            if (c->count == *capacity) {
                *capacity *= 2;
                c->cell = mem_realloc_array(c->cell, *capacity, sizeof *c->cell);
            }
            c->cell[c->count++] = (struct correction_cell){.chart = c->chart_of_triangle[triangle]};
            c->first[block + 1] = (uint32_t)c->count;
        }
    }
}

static void find_beside(struct correction *c, size_t block) {
    long column = (long)(block % c->columns), row = (long)(block / c->columns);
    for (uint32_t k = c->first[block]; k < c->first[block + 1]; k++) {
        struct correction_cell *cell = &c->cell[k];
        cell->beside[0] = cell_in(c, column - 1, row, cell->chart);
        cell->beside[1] = cell_in(c, column + 1, row, cell->chart);
        cell->beside[2] = cell_in(c, column, row - 1, cell->chart);
        cell->beside[3] = cell_in(c, column, row + 1, cell->chart);
    }
}

void correction_init(struct correction *c, struct texture *base_color, const struct inverse_uv *inverse,
                     const uint32_t *chart_of_triangle, uint32_t spacing) {
    *c = (struct correction){.base_color = base_color, .inverse = inverse, .chart_of_triangle = chart_of_triangle,
                             .spacing = spacing, .columns = (inverse->width + spacing - 1) / spacing,
                             .rows = (inverse->height + spacing - 1) / spacing};
    size_t blocks = (size_t)c->columns * c->rows, capacity = blocks;
    c->first = mem_calloc(blocks + 1, sizeof *c->first);
    c->cell = mem_array(capacity, sizeof *c->cell);
    for (size_t block = 0; block < blocks; block++)
        add_cells(c, block, &capacity);
    for (size_t block = 0; block < blocks; block++)
        find_beside(c, block);
    c->sums = mem_calloc(c->count, sizeof *c->sums);
    c->solved = mem_calloc_large((size_t)inverse->width * inverse->height, sizeof *c->solved);
    c->light = mem_calloc(c->count, sizeof *c->light);
}

void correction_release(struct correction *c) {
    mem_free(c->first);
    mem_free(c->cell);
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
    rgb *solved = mem_calloc(c->count, sizeof *solved), *shown = mem_calloc(c->count, sizeof *shown);
    for (size_t i = 0; i < c->inverse->valid_count; i++) {
        uint32_t texel = c->inverse->valid[i], cell = cell_of(c, texel);
        rgb radiance = fused_radiance(fused, texel);
        if (rgb_is_black(radiance))
            continue;
        float weight = fused->count[texel] > 0.0f ? 1.0f : UNCLEAN;
        solved[cell] = rgb_mad(solved[cell], weight, rgb_from_half(c->solved[texel]));
        shown[cell] = rgb_mad(shown[cell], weight, radiance);
    }
    for (size_t k = 0; k < c->count; k++) {
        rgb s = rgb_clamp(solved[k], LEAST_COLOR * UNCLEAN, INFINITY);
        c->light[k] = rgb_make(shown[k].r / s.r, shown[k].g / s.g, shown[k].b / s.b);
    }
    mem_free(shown);
    mem_free(solved);
}

/* --- looks -------------------------------------------------------------------------------------- */

rgb correction_expected(const struct correction *c, uint32_t texel) {
    return rgb_mul(c->light[cell_of(c, texel)], rgb_from_half(c->solved[texel]));
}

/* The mean of the channels by their weights; 0 where they have none. */
static float mean_by(const float value[3], const float weight[3]) {
    float sum = 0.0f, weights = 0.0f;
    for (int k = 0; k < 3; k++) {
        sum += weight[k] * value[k];
        weights += weight[k];
    }
    return weights > 0.0f ? sum / weights : 0.0f;
}

static float mean_of(const float value[3]) {
    return (value[0] + value[1] + value[2]) / 3.0f;
}

void correction_look(struct correction *c, uint32_t texel, const struct match *match, float weight) {
    struct correction_sums *s = &c->sums[cell_of(c, texel)];
    float off[3];
    for (int k = 0; k < 3; k++) {
        float worth = weight * match->worth[k];
        s->weight[k] += worth;
        s->shown[k] += worth * match->shown[k];
        s->rendered[k] += worth * match->rendered[k] * expf(-s->factor[k]);
        off[k] = match->shown[k] - match->rendered[k];
    }
    float gray = mean_by(off, match->worth);
    s->squared[CORRECTION_GRAY] += weight * mean_of(match->worth) * gray * gray;
    for (int k = 0; k < 3; k++)
        s->squared[CORRECTION_TINT] += weight / 3.0f * match->worth[k] * (off[k] - gray) * (off[k] - gray);
}

/* --- factors ------------------------------------------------------------------------------------ */

/* The logarithms of one kind, and of a channel where it is a tint, as least squares: drawn to what looks tell, to 0,
 * and to those of the cells beside. */
struct likely {
    const struct correction *correction;
    double to_one, to_beside; /* inverse variances */
    double *precision;        /* [count] of looks */
};

static void likely_multiply(const void *user, const double *value, double *out) {
    const struct likely *l = user;
    for (size_t i = 0; i < l->correction->count; i++) {
        out[i] = (l->precision[i] + l->to_one) * value[i];
        for (int k = 0; k < 4; k++) {
            uint32_t beside = l->correction->cell[i].beside[k];
            out[i] += beside == NONE ? 0.0 : l->to_beside * (value[i] - value[beside]);
        }
    }
}

/* By the diagonal. */
static void likely_precondition(const void *user, const double *residual, double *out) {
    const struct likely *l = user;
    for (size_t i = 0; i < l->correction->count; i++) {
        double diagonal = l->precision[i] + l->to_one;
        for (int k = 0; k < 4; k++)
            diagonal += l->correction->cell[i].beside[k] == NONE ? 0.0 : l->to_beside;
        out[i] = residual[i] / diagonal;
    }
}

/* Mean squares of what looks in the whole room are off by. */
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

/* How sure the looks at a cell are of its logarithms of one kind, as the inverse of a variance; of a channel where it is
 * a tint. */
static float precision_of(const struct correction_sums *s, int kind, int channel, float room) {
    float weight = mean_of(s->weight), variance = (s->squared[kind] + ROOM_LOOKS * room) / (weight + ROOM_LOOKS);
    return variance > 0.0f ? (kind == CORRECTION_GRAY ? weight : s->weight[channel]) / variance : 0.0f;
}

/* Logarithm of shown over rendered, by channel; 0 where nothing was rendered. */
static void told_by(const struct correction_sums *s, float log_ratio[3]) {
    for (int k = 0; k < 3; k++)
        log_ratio[k] = s->shown[k] > 0.0f && s->rendered[k] > 0.0f ? logf(s->shown[k] / s->rendered[k]) : 0.0f;
}

/* Adds to factor[count][3] the most likely logarithms of one kind, of a channel where it is a tint. They are sought
 * from 0 and not from what they were, or to apply twice would be to seek for longer. */
static void add_kind(const struct correction *c, int kind, int channel, float room, float (*factor)[3]) {
    struct likely l = {c, 1.0 / (about_one[kind] * about_one[kind]), 1.0 / (about_beside[kind] * about_beside[kind]),
                       mem_array(c->count, sizeof *l.precision)};
    const struct conjugate_system system = {c->count, likely_multiply, likely_precondition, &l};
    double *value = mem_calloc(c->count, sizeof *value), *residual = mem_array(c->count, sizeof *residual);
    for (size_t i = 0; i < c->count; i++) {
        float told[3];
        told_by(&c->sums[i], told);
        float gray = mean_by(told, c->sums[i].weight);
        l.precision[i] = (double)precision_of(&c->sums[i], kind, channel, room);
        residual[i] = l.precision[i] * (double)(kind == CORRECTION_GRAY ? gray : told[channel] - gray);
    }
    double goal = RESIDUAL_PART * conjugate_dot(residual, residual, c->count);
    conjugate_solve(&system, STEPS_MOST, goal, residual, value);
    for (size_t i = 0; i < c->count; i++)
        for (int k = 0; k < 3; k++)
            factor[i][k] += kind == CORRECTION_GRAY || k == channel ? (float)value[i] : 0.0f;
    mem_free(l.precision);
    mem_free(residual);
    mem_free(value);
}

static void find_factors(struct correction *c) {
    float(*factor)[3] = mem_calloc(c->count, sizeof *factor);
    float room[CORRECTION_KINDS];
    room_variance(c, room);
    add_kind(c, CORRECTION_GRAY, 0, room[CORRECTION_GRAY], factor);
    for (int channel = 0; channel < 3; channel++)
        add_kind(c, CORRECTION_TINT, channel, room[CORRECTION_TINT], factor);
    for (size_t i = 0; i < c->count; i++)
        for (int k = 0; k < 3; k++)
            c->sums[i].factor[k] = clampf(factor[i][k], -MOST_MOVED, MOST_MOVED);
    mem_free(factor);
}

/* --- texels ------------------------------------------------------------------------------------- */

/* The logarithms at a valid texel: bilinear between the middles of the cells of its chart. */
static void factor_at(const struct correction *c, uint32_t texel, float factor[3]) {
    uint32_t width = c->inverse->width, chart = c->chart_of_triangle[c->inverse->triangle[texel]];
    float x = ((float)(texel % width) + 0.5f) / (float)c->spacing - 0.5f;
    float y = ((float)(texel / width) + 0.5f) / (float)c->spacing - 0.5f;
    long column = (long)floorf(x), row = (long)floorf(y);
    float tx = x - (float)column, ty = y - (float)row, weights = 0.0f;
    factor[0] = factor[1] = factor[2] = 0.0f;
    for (int tap = 0; tap < 4; tap++) {
        uint32_t cell = cell_in(c, column + (tap & 1), row + (tap >> 1), chart);
        if (cell == NONE)
            continue;
        float weight = (tap & 1 ? tx : 1.0f - tx) * (tap & 2 ? ty : 1.0f - ty) + 1e-6f;
        for (int k = 0; k < 3; k++)
            factor[k] += weight * c->sums[cell].factor[k];
        weights += weight;
    }
    for (int k = 0; k < 3; k++)
        factor[k] /= weights;
}

static void move_row(void *user, size_t row, int thread) {
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
            c->base_color->texel[texel][k] = clampf(from[k] * expf(factor[k]), LEAST_COLOR, 1.0f);
    }
}

void correction_apply(struct correction *c, struct parallel *pool) {
    find_factors(c);
    parallel_for(pool, c->inverse->height, move_row, c);
}
