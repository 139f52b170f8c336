/* atlas.c -- see atlas.h. Charts are rasterised at a density and packed; a search finds the greatest density that
 * fits.
 *
 * Packing works on cells of `cell` texels: 1 up to MAX_GRID texels a side, a power of two beyond, so its time does
 * not grow with the size. Chart coordinates are rounded to units (coverage.h) before anything is decided, and charts
 * are moved and turned by whole texels: a chart covers exactly those texels in the atlas that it was packed with. */
#include "server/scene/atlas.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/scene/atlas_chart.h"
#include "server/scene/atlas_pack.h"
#include "server/scene/coverage.h"

#define MAX_GRID 2048         /* cells a side */
#define INSET 2               /* units between a chart and its box: more than coverage's margin */
#define TEXEL_FILL 0.75       /* share of the texels that the mesh's area fills; sizes a texel before packing */
#define FIRST_FILL 0.96       /* share of the cells that shapes and padding fill in the first try */
#define GUESS_ROUNDS 4        /* rasterisations to find the density for FIRST_FILL */
#define SEARCH_STEP 1.015     /* factor on density until one fits and one does not */
#define SEARCH_END 1.003      /* ratio of those two at which the search stops */
#define MIN_DENSITY 1e-3      /* of density_bound: below this packing has failed */
#define SHRINK 0.8            /* of a density at which a chart is larger than the grid */
#define SINGLE_TEXEL_FILL 0.9 /* share of the texels that charts of one texel each can fill */

/* All charts rasterised at one density. */
struct raster {
    struct pack_item *item; /* [chart_count] */
    uint64_t *bits;
    size_t bit_capacity; /* words */
};

static int32_t units_of(float metres, double density) {
    return INSET + (int32_t)lrint((double)metres * density * COVERAGE_UNITS);
}

static struct coverage_triangle place_of(const struct charts *charts, uint32_t triangle, double density) {
    struct coverage_triangle place;
    for (int c = 0; c < 3; c++) {
        place.x[c] = units_of(charts->corner[triangle][c].x, density);
        place.y[c] = units_of(charts->corner[triangle][c].y, density);
    }
    return place;
}

/* Sets the boxes of all charts, in cells of `cell` units; false when one exceeds `grid` cells. */
static bool measure(struct raster *raster, const struct charts *charts, double density, int32_t cell, uint32_t grid,
                    size_t *words) {
    *words = 0;
    for (size_t c = 0; c < charts->count; c++) {
        double side = (double)fmaxf(charts->extent[c].x, charts->extent[c].y) * density;
        if (side * COVERAGE_UNITS > (double)grid * cell)
            return false;
        struct pack_item *item = &raster->item[c];
        item->width = (uint32_t)((units_of(charts->extent[c].x, density) + INSET + cell - 1) / cell);
        item->height = (uint32_t)((units_of(charts->extent[c].y, density) + INSET + cell - 1) / cell);
        if (item->width > grid || item->height > grid)
            return false;
        *words += item->height * pack_words(item->width);
    }
    return true;
}

/* Rasterises all charts at `density` texels per metre. */
static bool rasterise(struct raster *raster, const struct charts *charts, double density, int32_t cell, uint32_t grid) {
    size_t words;
    if (!measure(raster, charts, density, cell, grid, &words))
        return false;
    if (words > raster->bit_capacity) {
        mem_free(raster->bits);
        raster->bits = mem_array(words, sizeof *raster->bits);
        raster->bit_capacity = words;
    }
    memset(raster->bits, 0, words * sizeof *raster->bits);
    uint64_t *bits = raster->bits;
    for (size_t c = 0; c < charts->count; c++) {
        struct pack_item *item = &raster->item[c];
        size_t stride = pack_words(item->width);
        item->row = bits;
        for (size_t i = charts->start[c]; i < charts->start[c + 1]; i++) {
            struct coverage_triangle place = place_of(charts, charts->triangle[i], density);
            int32_t y0, y1, x0, x1;
            coverage_rows(&place, cell, &y0, &y1);
            for (int32_t y = y0; y <= y1; y++) {
                coverage_columns(&place, cell, y, &x0, &x1);
                for (int32_t x = x0; x <= x1; x++)
                    bits[(size_t)y * stride + (size_t)x / 64] |= UINT64_C(1) << (x % 64);
            }
        }
        bits += item->height * stride;
    }
    return true;
}

static void raster_release(struct raster *raster) {
    mem_free(raster->item);
    mem_free(raster->bits);
}

/* The geometry of packing at one size. */
struct pack_grid {
    uint32_t size;    /* texels */
    uint32_t cell;    /* texels */
    uint32_t cells;   /* a side */
    uint32_t padding; /* cells */
};

static struct pack_grid grid_of(uint32_t size, uint32_t padding) {
    struct pack_grid grid = {.size = size, .cell = 1};
    while (size / grid.cell > MAX_GRID)
        grid.cell *= 2;
    grid.cells = size / grid.cell;
    grid.padding = (padding + grid.cell - 1) / grid.cell;
    return grid;
}

/* Area of the shape in cells, dilated by a square of padding + 1 cells. Dilated shapes are disjoint exactly where the
 * padding is kept. */
static size_t padded_cells(const struct pack_item *item, uint32_t padding) {
    size_t words = pack_words(item->width), count = 0;
    for (uint32_t y = 0; y < item->height + padding; y++) {
        uint64_t before = 0; /* previous word, whose last bits dilate into this one */
        uint32_t first = y > padding ? y - padding : 0;
        uint32_t last = y < item->height ? y : item->height - 1;
        for (size_t i = 0; i <= words; i++) {
            uint64_t column = 0; /* union of the rows that dilate into this one */
            for (uint32_t r = first; r <= last && i < words; r++)
                column |= item->row[r * words + i];
            uint64_t wide = column;
            for (uint32_t shift = 1; shift <= padding; shift++)
                wide |= column << shift | before >> (64 - shift);
            count += (size_t)__builtin_popcountll(wide);
            before = column;
        }
    }
    return count;
}

/* Share of the grid that the dilated shapes fill; infinite when one is larger than the grid. Above 1 they cannot
 * fit. */
static double fill_at(struct raster *raster, const struct charts *charts, double density,
                      const struct pack_grid *grid) {
    if (!rasterise(raster, charts, density, (int32_t)grid->cell * COVERAGE_UNITS, grid->cells))
        return INFINITY;
    size_t cells = 0;
    for (size_t c = 0; c < charts->count; c++)
        cells += padded_cells(&raster->item[c], grid->padding);
    double side = (double)(grid->cells + grid->padding); /* padding may stick out */
    return (double)cells / (side * side);
}

/* A density above which the area or the longest chart cannot fit. */
static double density_bound(const struct charts *charts, const struct pack_grid *grid) {
    double longest = 0.0;
    for (size_t c = 0; c < charts->count; c++)
        longest = fmax(longest, (double)fmaxf(charts->extent[c].x, charts->extent[c].y));
    return fmin((double)grid->size / sqrt(charts->flat_area), (double)grid->size / longest);
}

/* A density at which the shapes fill about FIRST_FILL of the grid. */
static double guess_density(struct raster *raster, const struct charts *charts, const struct pack_grid *grid,
                            double full) {
    double density = full;
    for (int round = 0; round < GUESS_ROUNDS; round++) {
        double fill = fill_at(raster, charts, density, grid);
        density = fmin(density * (isfinite(fill) ? sqrt(FIRST_FILL / fill) : SHRINK), full);
    }
    return density;
}

#define MAX_PADDING_COST 1.2 /* of the area that the dilated shapes fill: a tenth of the density */

/* What automatic padding is for these charts. */
static uint32_t choose_padding(const struct charts *charts, uint32_t size) {
    struct raster trial = {.item = mem_calloc(charts->count, sizeof *trial.item)};
    struct pack_grid narrow = grid_of(size, ATLAS_PADDING), wide = grid_of(size, ATLAS_WIDE_PADDING);
    double density = guess_density(&trial, charts, &narrow, density_bound(charts, &narrow));
    double least = fill_at(&trial, charts, density, &narrow), most = fill_at(&trial, charts, density, &wide);
    raster_release(&trial);
    return isfinite(most) && most <= MAX_PADDING_COST * least ? ATLAS_WIDE_PADDING : ATLAS_PADDING;
}

/* Searches the greatest density that fits and leaves its packing in `best`; 0 when none does. */
static double search_density(struct raster *best, const struct charts *charts, const struct pack_grid *grid) {
    struct raster trial = {.item = mem_calloc(charts->count, sizeof *trial.item)};
    double full = density_bound(charts, grid);
    double density = guess_density(&trial, charts, grid, full);
    double fits = 0.0, fails = INFINITY, step = SEARCH_STEP;
    while (density > full * MIN_DENSITY && (fits == 0.0 || fails / fits > SEARCH_END)) {
        if (fill_at(&trial, charts, density, grid) <= 1.0 &&
            pack(trial.item, charts->count, grid->cells, grid->padding)) {
            struct raster old = *best;
            *best = trial;
            trial = old;
            fits = density;
        } else {
            fails = density;
        }
        if (fits > 0.0 && isfinite(fails)) {
            density = sqrt(fits * fails);
        } else {
            density = fits > 0.0 ? density * step : density / step;
            step *= SEARCH_STEP; /* the first guess may be far off */
        }
    }
    raster_release(&trial);
    return fits;
}

/* Sets the atlas coordinates from the packing. */
static void set_corners(struct atlas *atlas, const struct charts *charts, const struct raster *raster,
                        const struct pack_grid *grid, double density) {
    int32_t cell = (int32_t)grid->cell * COVERAGE_UNITS;
    for (size_t c = 0; c < charts->count; c++) {
        const struct pack_item *item = &raster->item[c];
        int32_t w = (int32_t)item->width * cell, h = (int32_t)item->height * cell;
        for (size_t i = charts->start[c]; i < charts->start[c + 1]; i++) {
            struct coverage_triangle place = place_of(charts, charts->triangle[i], density);
            vec2 *corner = atlas->corner[charts->triangle[i]];
            for (int k = 0; k < 3; k++) {
                int32_t x, y;
                pack_turn(item->quarter, w, h, place.x[k], place.y[k], &x, &y);
                corner[k] = (vec2){(float)(x + (int32_t)item->x * cell) / COVERAGE_UNITS,
                                   (float)(y + (int32_t)item->y * cell) / COVERAGE_UNITS};
            }
        }
    }
}

/* Number of texels covered by all charts; rasterises them again, one texel per cell. */
static size_t covered_texels(struct raster *raster, const struct charts *charts, double density) {
    size_t count = 0, words = 0;
    rasterise(raster, charts, density, COVERAGE_UNITS, UINT32_MAX / COVERAGE_UNITS);
    for (size_t c = 0; c < charts->count; c++)
        words += raster->item[c].height * pack_words(raster->item[c].width);
    for (size_t i = 0; i < words; i++)
        count += (size_t)__builtin_popcountll(raster->bits[i]);
    return count;
}

static void finish(struct atlas *atlas, struct charts *charts, struct raster *raster, const struct pack_grid *grid,
                   double density, size_t triangle_count) {
    *atlas = (struct atlas){.width = grid->size,
                            .height = grid->size,
                            .texels_per_metre = (float)density,
                            .chart_count = charts->count,
                            .padding = grid->padding * grid->cell};
    atlas->corner = mem_array(triangle_count, sizeof *atlas->corner);
    set_corners(atlas, charts, raster, grid, density);
    atlas->utilisation = (double)covered_texels(raster, charts, density) / ((double)grid->size * grid->size);
    atlas->chart_of_triangle = charts->of_triangle;
    charts->of_triangle = NULL;
}

/* The smallest power of two that holds `count` charts of one texel each, with padding. */
static double size_for(size_t count, uint32_t padding) {
    double cells = (double)count * (1.0 + padding) * (1.0 + padding) / SINGLE_TEXEL_FILL;
    return exp2(ceil(log2(sqrt(cells))));
}

/* Scales each chart by the maximum density of its triangles. */
static void shrink_charts(struct charts *charts, const float *density) {
    charts->flat_area = 0.0;
    for (size_t c = 0; c < charts->count; c++) {
        float most = 0.0f;
        for (size_t i = charts->start[c]; i < charts->start[c + 1]; i++)
            most = fmaxf(most, density[charts->triangle[i]]);
        charts->extent[c] = vec2_scale(charts->extent[c], most);
        for (size_t i = charts->start[c]; i < charts->start[c + 1]; i++) {
            vec2 *corner = charts->corner[charts->triangle[i]];
            for (int k = 0; k < 3; k++)
                corner[k] = vec2_scale(corner[k], most);
            vec2 a = vec2_sub(corner[1], corner[0]), b = vec2_sub(corner[2], corner[0]);
            charts->flat_area += 0.5 * fabs((double)a.x * (double)b.y - (double)a.y * (double)b.x);
        }
    }
}

/* `density` may be NULL. */
static enum status make_at_size(struct atlas *atlas, const struct mesh *mesh, const struct segments *segments,
                                uint32_t size, const float *density_of, uint32_t padding, struct error *err) {
    struct charts charts;
    float texel_m = (float)sqrt(mesh_area(mesh) / TEXEL_FILL) / (float)size;
    charts_make(&charts, mesh, segments, texel_m);
    if (density_of)
        shrink_charts(&charts, density_of);
    if (padding == ATLAS_AUTOMATIC_PADDING)
        padding = choose_padding(&charts, size);
    struct pack_grid grid = grid_of(size, padding);
    struct raster raster = {.item = mem_calloc(charts.count, sizeof *raster.item)};
    double density = search_density(&raster, &charts, &grid);
    enum status status = STATUS_OK;
    if (density > 0.0) {
        finish(atlas, &charts, &raster, &grid, density, mesh->triangle_count);
    } else {
        double needed = fmax(size_for(charts.count, padding), 2.0 * size);
        status = error_set(err, STATUS_INPUT,
                           "the mesh is in %zu pieces: a texture of %u x %u texels "
                           "cannot hold them",
                           charts.count, size, size);
        if (needed <= ATLAS_MAX_SIZE)
            error_hint(err, "a texture_size of %.0f would", needed);
        else
            error_hint(err, "no size up to %d would: join the mesh's pieces", ATLAS_MAX_SIZE);
    }
    raster_release(&raster);
    charts_release(&charts);
    return status;
}

static enum status make_at_density(struct atlas *atlas, const struct mesh *mesh, const struct segments *segments,
                                   float texels_per_metre, uint32_t padding, struct error *err) {
    struct charts charts;
    charts_make(&charts, mesh, segments, 1.0f / texels_per_metre);
    struct raster raster = {.item = mem_calloc(charts.count, sizeof *raster.item)};
    double density = (double)texels_per_metre, least = density * sqrt(charts.flat_area);
    uint32_t size = 64;
    enum status status = STATUS_OK;
    for (bool fits = false; !fits && status == STATUS_OK; size *= 2) {
        if (size > ATLAS_MAX_SIZE) {
            status = error_set(err, STATUS_INPUT,
                               "%g texels per metre need a texture of %.0f x %.0f "
                               "texels or more; %d is the most",
                               (double)texels_per_metre, ceil(least), ceil(least), ATLAS_MAX_SIZE);
            break;
        }
        struct pack_grid grid = grid_of(size, padding ? padding : choose_padding(&charts, size));
        fits = fill_at(&raster, &charts, density, &grid) <= 1.0 &&
               pack(raster.item, charts.count, grid.cells, grid.padding);
        if (fits)
            finish(atlas, &charts, &raster, &grid, density, mesh->triangle_count);
    }
    raster_release(&raster);
    charts_release(&charts);
    return status;
}

enum status atlas_make(struct atlas *atlas, const struct mesh *mesh, const struct segments *segments, uint32_t size,
                       float texels_per_metre, uint32_t padding, struct error *err) {
    if (texels_per_metre != 0.0f) {
        if (!(texels_per_metre > 0.0f) || !isfinite(texels_per_metre))
            return error_set(err, STATUS_INPUT, "texels per metre: %g is not a positive number",
                             (double)texels_per_metre);
        return make_at_density(atlas, mesh, segments, texels_per_metre, padding, err);
    }
    return atlas_make_uneven(atlas, mesh, segments, size, NULL, padding, err);
}

enum status atlas_make_uneven(struct atlas *atlas, const struct mesh *mesh, const struct segments *segments,
                              uint32_t size, const float *density, uint32_t padding, struct error *err) {
    if (size == 0 || size > ATLAS_MAX_SIZE)
        return error_set(err, STATUS_INPUT, "texture size: %u is not within 1 to %d", size, ATLAS_MAX_SIZE);
    return make_at_size(atlas, mesh, segments, size, density, padding, err);
}

void atlas_release(struct atlas *atlas) {
    mem_free(atlas->chart_of_triangle);
    mem_free(atlas->corner);
    *atlas = (struct atlas){0};
}
