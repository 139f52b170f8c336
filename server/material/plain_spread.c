/* plain_spread.c -- see plain_spread.h. */
#include "server/material/plain_spread.h"

#include <math.h>
#include <stdlib.h>

#include "common/mem.h"
#include "common/quantile.h"

/* Blocks along a side of the atlas: at any texture size a cell is the same piece of surface. Half as many: den .0056 in
 * place of .0061; twice as many: .0068. */
#define BLOCKS 64
#define CELL_SHARE 4 /* of a block's texels one in so many must be a cell's; +25 %: no change */
/* Cells of a chart from which its median is one; 4: den .0059. */
#define CHART_CELLS 8
#define MIN_COLOR 1e-3f /* of the logarithm's argument */

struct spread_cell {
    uint32_t chart;
    size_t count; /* texels */
    double color; /* mean of the channels, summed over them */
};

struct cells {
    size_t count, capacity;
    struct spread_cell *cell; /* owned */
};

struct spread_job {
    const struct surface *surface;
    const struct texture *base_color;
    const float *observed;
    const bool *is_emitter;
    uint32_t side; /* texels of a block */
};

/* The cell of `chart` among those from `first` on, which are of one block; a new one if there is none. */
static struct spread_cell *cell_of(struct cells *cells, size_t first, uint32_t chart) {
    for (size_t i = cells->count; i-- > first;)
        if (cells->cell[i].chart == chart)
            return &cells->cell[i];
    if (cells->count == cells->capacity) {
        cells->capacity = cells->capacity ? 2 * cells->capacity : 1024;
        cells->cell = mem_realloc_array(cells->cell, cells->capacity, sizeof *cells->cell);
    }
    cells->cell[cells->count] = (struct spread_cell){.chart = chart};
    return &cells->cell[cells->count++];
}

/* Appends the cells of the block with the corner (x0, y0). */
static void add_block(const struct spread_job *job, uint32_t x0, uint32_t y0, struct cells *cells) {
    const struct inverse_uv *inverse = job->surface->inverse;
    size_t first = cells->count, kept = first;
    for (uint32_t y = y0; y < y0 + job->side && y < inverse->height; y++) {
        for (uint32_t x = x0; x < x0 + job->side && x < inverse->width; x++) {
            uint32_t texel = y * inverse->width + x;
            if (inverse->triangle[texel] == INVERSE_UV_NONE || !(job->observed[texel] > 0.0f) ||
                job->is_emitter[surface_segment(job->surface, texel)])
                continue;
            struct spread_cell *cell = cell_of(cells, first, surface_chart(job->surface, texel));
            const float *color = job->base_color->texel[texel];
            cell->color += (double)(color[0] + color[1] + color[2]) / 3.0;
            cell->count++;
        }
    }
    for (size_t i = first; i < cells->count; i++)
        if (CELL_SHARE * cells->cell[i].count >= (size_t)job->side * job->side)
            cells->cell[kept++] = cells->cell[i];
    cells->count = kept;
}

static int compare_charts(const void *a, const void *b) {
    const struct spread_cell *x = a, *y = b;
    return (x->chart > y->chart) - (x->chart < y->chart);
}

static float log_color(const struct spread_cell *cell) {
    return logf(fmaxf((float)(cell->color / (double)cell->count), MIN_COLOR));
}

/* off[]: distances of the `count` cells of a chart from their median; `scratch` of the same size. */
static void chart_distances(const struct spread_cell *cell, size_t count, float *off, float *scratch) {
    for (size_t i = 0; i < count; i++)
        scratch[i] = off[i] = log_color(&cell[i]);
    float median = quantile(scratch, count, 0.5);
    for (size_t i = 0; i < count; i++)
        off[i] = fabsf(off[i] - median);
}

static float spread_of(struct cells *cells) {
    float *off = mem_array(cells->count + 1, sizeof *off), *scratch = mem_array(cells->count + 1, sizeof *scratch);
    size_t known = 0;
    qsort(cells->cell, cells->count, sizeof *cells->cell, compare_charts);
    for (size_t first = 0, end; first < cells->count; first = end) {
        for (end = first + 1; end < cells->count && cells->cell[end].chart == cells->cell[first].chart; end++)
            continue;
        if (end - first < CHART_CELLS)
            continue;
        chart_distances(cells->cell + first, end - first, off + known, scratch);
        known += end - first;
    }
    float spread = known < PLAIN_SPREAD_CELLS ? NAN : (float)QUANTILE_DEVIATIONS_PER_MAD * quantile(off, known, 0.5);
    mem_free(scratch);
    mem_free(off);
    return spread;
}

float plain_spread(const struct surface *surface, const struct texture *base_color, const float *observed,
                   const bool *is_emitter) {
    const struct inverse_uv *inverse = surface->inverse;
    uint32_t longest = inverse->width > inverse->height ? inverse->width : inverse->height;
    struct spread_job job = {surface, base_color, observed, is_emitter, (longest + BLOCKS - 1) / BLOCKS};
    struct cells cells = {0};
    for (uint32_t y = 0; y < inverse->height; y += job.side)
        for (uint32_t x = 0; x < inverse->width; x += job.side)
            add_block(&job, x, y, &cells);
    float spread = cells.count ? spread_of(&cells) : NAN;
    mem_free(cells.cell);
    return spread;
}
