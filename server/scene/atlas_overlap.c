/* atlas_overlap.c -- see atlas_overlap.h. Kept triangles are entered into a grid with about as
 * many cells as there are triangles; each new one is tested against those in its cells by
 * looking for an edge that separates the two. */
#include "server/scene/atlas_overlap.h"

#include <math.h>
#include <stdint.h>

#include "common/mem.h"

#define NONE UINT32_MAX /* the end of a list */

struct overlap_entry {
    uint32_t triangle, next;
};

struct overlap_grid {
    double x0, y0, per_metre;
    size_t columns, rows;
    uint32_t *head; /* [rows][columns] first entry or NONE */
    struct overlap_entry *entry;
    size_t entry_count, entry_capacity;
};

static double min3(const double v[3]) { return fmin(v[0], fmin(v[1], v[2])); }

static double max3(const double v[3]) { return fmax(v[0], fmax(v[1], v[2])); }

/* True when an edge of a has all of b at its outer side, but for `depth`. */
static bool edge_separates(const struct flat_triangle *a, const struct flat_triangle *b, double depth) {
    for (int i = 0; i < 3; i++) {
        int j = i == 2 ? 0 : i + 1;
        double ex = a->x[j] - a->x[i], ey = a->y[j] - a->y[i];
        double inside = depth * sqrt(ex * ex + ey * ey);
        bool all_outside = true;
        for (int k = 0; k < 3 && all_outside; k++)
            all_outside = ex * (b->y[k] - a->y[i]) - ey * (b->x[k] - a->x[i]) <= inside;
        if (all_outside)
            return true;
    }
    return false;
}

static size_t cell_at(double place, double origin, double per_metre) {
    return (size_t)fmax(0.0, (place - origin) * per_metre);
}

static void rows_of(const struct overlap_grid *g, const struct flat_triangle *t, size_t *first, size_t *last) {
    *first = cell_at(min3(t->y), g->y0, g->per_metre);
    *last = cell_at(max3(t->y), g->y0, g->per_metre);
}

/* Columns of the grid that the triangle meets in a row, which has some. The strip is taken a
 * little higher than the row: rounding must not lose a cell. */
static void columns_of(const struct overlap_grid *g, const struct flat_triangle *t, size_t row, size_t *first,
                       size_t *last) {
    double bottom = g->y0 + ((double)row - 0.01) / g->per_metre;
    double top = g->y0 + ((double)row + 1.01) / g->per_metre;
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < 3; i++) {
        int j = i == 2 ? 0 : i + 1;
        double dy = t->y[j] - t->y[i];
        if (fmax(t->y[i], t->y[j]) < bottom || fmin(t->y[i], t->y[j]) > top)
            continue;
        /* Parts of the edge at which it enters and leaves the strip. */
        double a = dy != 0.0 ? (bottom - t->y[i]) / dy : 0.0;
        double b = dy != 0.0 ? (top - t->y[i]) / dy : 1.0;
        double enter = fmin(1.0, fmax(0.0, fmin(a, b))), leave = fmax(0.0, fmin(1.0, fmax(a, b)));
        double x[2] = {t->x[i] + enter * (t->x[j] - t->x[i]), t->x[i] + leave * (t->x[j] - t->x[i])};
        low = fmin(low, fmin(x[0], x[1]));
        high = fmax(high, fmax(x[0], x[1]));
    }
    *first = cell_at(low - 0.01 / g->per_metre, g->x0, g->per_metre);
    *last = cell_at(high + 0.01 / g->per_metre, g->x0, g->per_metre);
    if (*last >= g->columns)
        *last = g->columns - 1;
}

static void grid_init(struct overlap_grid *g, const struct flat_triangle *triangle, size_t count) {
    double x1 = -INFINITY, y1 = -INFINITY;
    *g = (struct overlap_grid){.x0 = INFINITY, .y0 = INFINITY};
    for (size_t i = 0; i < count; i++) {
        g->x0 = fmin(g->x0, min3(triangle[i].x));
        g->y0 = fmin(g->y0, min3(triangle[i].y));
        x1 = fmax(x1, max3(triangle[i].x));
        y1 = fmax(y1, max3(triangle[i].y));
    }
    double width = x1 - g->x0, height = y1 - g->y0;
    /* Long thin charts: no more than `count` cells along either side. */
    double cell = fmax(sqrt(width * height / (double)count), fmax(width, height) / (double)count);
    g->per_metre = 1.0 / cell;
    g->columns = (size_t)(width * g->per_metre) + 1;
    g->rows = (size_t)(height * g->per_metre) + 1;
    g->head = mem_array(g->columns * g->rows, sizeof *g->head);
    for (size_t i = 0; i < g->columns * g->rows; i++)
        g->head[i] = NONE;
}

static void grid_release(struct overlap_grid *g) {
    mem_free(g->head);
    mem_free(g->entry);
}

static bool lies_over_one(const struct overlap_grid *g, const struct flat_triangle *triangle, size_t i, double depth) {
    size_t y, bottom, left, right;
    for (rows_of(g, &triangle[i], &y, &bottom); y <= bottom; y++) {
        columns_of(g, &triangle[i], y, &left, &right);
        for (size_t x = left; x <= right; x++)
            for (uint32_t e = g->head[y * g->columns + x]; e != NONE; e = g->entry[e].next) {
                const struct flat_triangle *other = &triangle[g->entry[e].triangle];
                if (!edge_separates(&triangle[i], other, depth) && !edge_separates(other, &triangle[i], depth))
                    return true;
            }
    }
    return false;
}

static void add(struct overlap_grid *g, size_t cell, size_t i) {
    if (g->entry_count == g->entry_capacity) {
        g->entry_capacity = g->entry_capacity ? 2 * g->entry_capacity : 256;
        g->entry = mem_realloc_array(g->entry, g->entry_capacity, sizeof *g->entry);
    }
    g->entry[g->entry_count] = (struct overlap_entry){(uint32_t)i, g->head[cell]};
    g->head[cell] = (uint32_t)g->entry_count++;
}

static void enter(struct overlap_grid *g, const struct flat_triangle *triangle, size_t i) {
    size_t y, bottom, left, right;
    for (rows_of(g, &triangle[i], &y, &bottom); y <= bottom; y++) {
        columns_of(g, &triangle[i], y, &left, &right);
        for (size_t x = left; x <= right; x++)
            add(g, y * g->columns + x, i);
    }
}

size_t overlap_mark_dropped(const struct flat_triangle *triangle, size_t count, double depth, bool *dropped) {
    struct overlap_grid g;
    size_t dropped_count = 0;
    grid_init(&g, triangle, count);
    for (size_t i = 0; i < count; i++) {
        dropped[i] = lies_over_one(&g, triangle, i, depth);
        if (dropped[i])
            dropped_count++;
        else
            enter(&g, triangle, i);
    }
    grid_release(&g);
    return dropped_count;
}
