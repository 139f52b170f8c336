/* atlas_overlap.c -- see atlas_overlap.h. Kept triangles are entered into a grid with about as
 * many cells as there are triangles; each new one is tested against those in its cells by
 * looking for an edge that separates the two. */
#include "server/scene/atlas_overlap.h"

#include <math.h>
#include <stdint.h>

#include "common/mem.h"

#define NONE UINT32_MAX

struct entry {
    uint32_t triangle, next;
};

struct grid {
    double x0, y0, per_metre;
    size_t columns, rows;
    uint32_t *head; /* [rows][columns] first entry or NONE */
    struct entry *entry;
    size_t entry_count, entry_capacity;
};

static double min3(const double v[3]) {
    return fmin(v[0], fmin(v[1], v[2]));
}

static double max3(const double v[3]) {
    return fmax(v[0], fmax(v[1], v[2]));
}

/* True when an edge of a has all of b at its outer side, but for `depth`. */
static bool edge_separates(const struct flat_triangle *a, const struct flat_triangle *b,
                           double depth) {
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

static void cells_of(const struct grid *g, const struct flat_triangle *t, size_t cell[4]) {
    cell[0] = (size_t)((min3(t->x) - g->x0) * g->per_metre);
    cell[1] = (size_t)((max3(t->x) - g->x0) * g->per_metre);
    cell[2] = (size_t)((min3(t->y) - g->y0) * g->per_metre);
    cell[3] = (size_t)((max3(t->y) - g->y0) * g->per_metre);
}

static void grid_init(struct grid *g, const struct flat_triangle *triangle, size_t count) {
    double x1 = -INFINITY, y1 = -INFINITY;
    *g = (struct grid){.x0 = INFINITY, .y0 = INFINITY};
    for (size_t i = 0; i < count; i++) {
        g->x0 = fmin(g->x0, min3(triangle[i].x));
        g->y0 = fmin(g->y0, min3(triangle[i].y));
        x1 = fmax(x1, max3(triangle[i].x));
        y1 = fmax(y1, max3(triangle[i].y));
    }
    double width = x1 - g->x0, height = y1 - g->y0;
    /* Long thin charts: no more than `count` cells along either side. */
    double cell = fmax(sqrt(width * height / (double)count), fmax(width, height) / (double)count);
    g->per_metre = cell > 0.0 ? 1.0 / cell : 0.0;
    g->columns = (size_t)(width * g->per_metre) + 1;
    g->rows = (size_t)(height * g->per_metre) + 1;
    g->head = mem_array(g->columns * g->rows, sizeof *g->head);
    for (size_t i = 0; i < g->columns * g->rows; i++)
        g->head[i] = NONE;
}

static void grid_release(struct grid *g) {
    mem_free(g->head);
    mem_free(g->entry);
}

static bool lies_over_one(const struct grid *g, const struct flat_triangle *triangle, size_t i,
                          const size_t cell[4], double depth) {
    for (size_t y = cell[2]; y <= cell[3]; y++)
        for (size_t x = cell[0]; x <= cell[1]; x++)
            for (uint32_t e = g->head[y * g->columns + x]; e != NONE; e = g->entry[e].next) {
                const struct flat_triangle *other = &triangle[g->entry[e].triangle];
                if (!edge_separates(&triangle[i], other, depth) &&
                    !edge_separates(other, &triangle[i], depth))
                    return true;
            }
    return false;
}

static void enter(struct grid *g, size_t i, const size_t cell[4]) {
    for (size_t y = cell[2]; y <= cell[3]; y++)
        for (size_t x = cell[0]; x <= cell[1]; x++) {
            if (g->entry_count == g->entry_capacity) {
                g->entry_capacity = g->entry_capacity ? 2 * g->entry_capacity : 256;
                g->entry = mem_realloc_array(g->entry, g->entry_capacity, sizeof *g->entry);
            }
            uint32_t *head = &g->head[y * g->columns + x];
            g->entry[g->entry_count] = (struct entry){(uint32_t)i, *head};
            *head = (uint32_t)g->entry_count++;
        }
}

size_t overlap_drop(const struct flat_triangle *triangle, size_t count, double depth,
                    bool *dropped) {
    struct grid g;
    size_t dropped_count = 0, cell[4];
    grid_init(&g, triangle, count);
    for (size_t i = 0; i < count; i++) {
        cells_of(&g, &triangle[i], cell);
        dropped[i] = lies_over_one(&g, triangle, i, cell, depth);
        if (dropped[i])
            dropped_count++;
        else
            enter(&g, i, cell);
    }
    grid_release(&g);
    return dropped_count;
}
