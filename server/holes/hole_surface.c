/* hole_surface.c -- see hole_surface.h. */
#include "server/holes/hole_surface.h"

#include <string.h>

#include "common/mem.h"

/* How far behind the mesh the added surface goes on, in cells: 1 mm in a room, as far as denoised scans are off. */
#define SINK_CELLS 0.02f
#define CLOSINGS 4         /* rounds in which cells that no photograph shows are closed, each by those around */
#define CLOSED_AROUND 5    /* of the eight around, that are filled or covered */
#define MEMBRANE_STEPS 100 /* of Gauss and Seidel: heights are millimetres, so that the last digit does not matter */

/* What becomes of a cell. */
enum { CELL_EMPTY, CELL_FILLED, CELL_BEHIND };

struct hole_patch {
    const struct hole_grid *grid;
    const struct hole_plane *plane;
    uint8_t *state;   /* [rows][columns] */
    uint32_t *region; /* [rows][columns] of the hole that it is part of */
    float *height_m;  /* [rows + 1][columns + 1] of corners over the plane; NAN: no corner */
    bool *is_fixed;   /* [rows + 1][columns + 1] */
    uint32_t *vertex; /* [rows + 1][columns + 1] of the mesh */
};

static const struct hole_cell *cell_of(const struct hole_patch *p, uint32_t number) {
    return &p->grid->cell[p->plane->first + number];
}

/* Cell number `at` moved by (columns, rows), as a number within the plane; HOLE_NO_CELL beyond it. */
static uint32_t beside(const struct hole_patch *p, uint32_t at, int k) {
    uint32_t n = hole_grid_neighbour(p->plane, p->plane->first + at, k % 3 - 1, k / 3 - 1);
    return n == HOLE_NO_CELL ? n : n - p->plane->first;
}

/* Fills cells of which nothing is known, where most around are filled or covered. */
static void close_unseen(struct hole_patch *p) {
    uint32_t count = p->plane->columns * p->plane->rows;
    uint32_t *to_fill = mem_array(count + 1, sizeof *to_fill), *region = mem_array(count + 1, sizeof *region);
    for (int round = 0; round < CLOSINGS; round++) {
        uint32_t found = 0;
        for (uint32_t i = 0; i < count; i++) {
            const struct hole_cell *cell = cell_of(p, i);
            uint32_t around = 0, of = HOLE_NO_CELL;
            if (p->state[i] != CELL_EMPTY || hole_cell_is_covered(cell) || cell->opened > 0 || cell->passed > 0 ||
                cell->is_refused)
                continue;
            for (int k = 0; k < 9; k++) {
                uint32_t n = k == 4 ? HOLE_NO_CELL : beside(p, i, k);
                if (n == HOLE_NO_CELL)
                    continue;
                bool is_filled = p->state[n] == CELL_FILLED;
                around += is_filled || hole_cell_is_covered(cell_of(p, n));
                of = is_filled && of == HOLE_NO_CELL ? p->region[n] : of;
            }
            if (around < CLOSED_AROUND || of == HOLE_NO_CELL)
                continue;
            to_fill[found] = i;
            region[found++] = of;
        }
        for (uint32_t i = 0; i < found; i++) {
            p->state[to_fill[i]] = CELL_FILLED;
            p->region[to_fill[i]] = region[i];
        }
    }
    mem_free(region);
    mem_free(to_fill);
}

/* Has the surface go on behind covered cells beside it. */
static void go_behind(struct hole_patch *p) {
    for (uint32_t i = 0; i < p->plane->columns * p->plane->rows; i++) {
        for (int k = 0; k < 9 && p->state[i] == CELL_EMPTY && hole_cell_is_covered(cell_of(p, i)); k++) {
            uint32_t n = beside(p, i, k);
            if (n == HOLE_NO_CELL || p->state[n] != CELL_FILLED)
                continue;
            p->state[i] = CELL_BEHIND;
            p->region[i] = p->region[n];
        }
    }
}

static uint32_t corner_of(const struct hole_patch *p, uint32_t cell, uint32_t column, uint32_t row) {
    return (cell / p->plane->columns + row) * (p->plane->columns + 1) + cell % p->plane->columns + column;
}

/* Corners of covered cells lie behind the lowest of them; the others are on the plane at first. */
static void fix_corners(struct hole_patch *p) {
    uint32_t corners = (p->plane->columns + 1) * (p->plane->rows + 1);
    for (uint32_t i = 0; i < corners; i++)
        p->height_m[i] = NAN;
    for (uint32_t i = 0; i < p->plane->columns * p->plane->rows; i++) {
        const struct hole_cell *cell = cell_of(p, i);
        bool is_covered = hole_cell_is_covered(cell);
        float height = is_covered ? cell->height_m - SINK_CELLS * p->grid->side_m : 0.0f;
        for (uint32_t k = 0; k < 4 && p->state[i] != CELL_EMPTY; k++) {
            uint32_t at = corner_of(p, i, k & 1, k >> 1);
            bool is_first = isnan(p->height_m[at]) || (is_covered && !p->is_fixed[at]);
            if (is_first || (is_covered && height < p->height_m[at]))
                p->height_m[at] = height;
            p->is_fixed[at] |= is_covered;
        }
    }
}

/* Moves free corners to the mean of those around. */
static void stretch(struct hole_patch *p) {
    uint32_t width = p->plane->columns + 1, height = p->plane->rows + 1;
    for (int step = 0; step < MEMBRANE_STEPS; step++) {
        for (uint32_t i = 0; i < width * height; i++) {
            uint32_t x = i % width, y = i / width;
            const float around[4] = {x > 0 ? p->height_m[i - 1] : NAN, x + 1 < width ? p->height_m[i + 1] : NAN,
                                     y > 0 ? p->height_m[i - width] : NAN,
                                     y + 1 < height ? p->height_m[i + width] : NAN};
            float sum = 0.0f, count = 0.0f;
            for (int k = 0; k < 4; k++) {
                sum += isnan(around[k]) ? 0.0f : around[k];
                count += isnan(around[k]) ? 0.0f : 1.0f;
            }
            if (!isnan(p->height_m[i]) && !p->is_fixed[i] && count > 0.0f)
                p->height_m[i] = sum / count;
        }
    }
}

/* --- the mesh ------------------------------------------------------------------------------------- */

/* The triangle whose segment a region continues: one of the segment that most of the covered cells in and beside it
 * have. There are some: a region without is none. votes[segment_count]: 0. */
static uint32_t pattern_of(const struct hole_patch *p, const struct segments *segments, uint32_t region,
                           uint32_t *votes) {
    uint32_t best = ACCEL_NONE, most = 0, count = p->plane->columns * p->plane->rows;
    for (int pass = 0; pass < 2; pass++) { /* counts votes; takes them back */
        for (uint32_t i = 0; i < count; i++) {
            for (int k = 0; k < 9 && cell_of(p, i)->region == region; k++) {
                uint32_t n = beside(p, i, k);
                if (n == HOLE_NO_CELL || !hole_cell_is_covered(cell_of(p, n)))
                    continue;
                uint32_t triangle = cell_of(p, n)->triangle, *vote = &votes[segments->of_triangle[triangle]];
                *vote = pass == 0 ? *vote + 1 : 0;
                best = *vote > most ? triangle : best;
                most = *vote > most ? *vote : most;
            }
        }
    }
    return best;
}

static void add_vertices(struct hole_patch *p, struct mesh *mesh) {
    uint32_t width = p->plane->columns + 1, corners = width * (p->plane->rows + 1), count = 0;
    for (uint32_t i = 0; i < corners; i++)
        count += isnan(p->height_m[i]) ? 0 : 1;
    mesh_reserve(mesh, count, 0);
    for (uint32_t i = 0; i < corners; i++) {
        if (isnan(p->height_m[i]))
            continue;
        vec3 corner = hole_plane_corner(p->grid, p->plane, i % width, i / width);
        p->vertex[i] = (uint32_t)mesh->vertex_count;
        mesh->position[mesh->vertex_count] = vec3_mad(corner, p->height_m[i], p->plane->plane.normal);
        if (mesh->normal)
            mesh->normal[mesh->vertex_count] = p->plane->plane.normal;
        mesh->vertex_count++;
    }
}

static void add_triangle(struct mesh *mesh, struct segments *segments, uint32_t a, uint32_t b, uint32_t c,
                         uint32_t pattern) {
    size_t t = mesh->triangle_count++;
    mesh->index[t][0] = a;
    mesh->index[t][1] = b;
    mesh->index[t][2] = c;
    mesh->face[t] = MESH_NO_FACE;
    if (mesh->object_id)
        mesh->object_id[t] = mesh->object_id[pattern];
    for (int k = 0; k < 3 && mesh->uv; k++)
        mesh->uv[t][k] = (vec2){NAN, NAN}; /* the input's picture has no place for it */
    segments->of_triangle[t] = segments->of_triangle[pattern];
}

/* pattern[region]: the triangle that it continues. */
static void add_triangles(const struct hole_patch *p, struct mesh *mesh, struct segments *segments,
                          const uint32_t *pattern) {
    size_t count = 0, cells = (size_t)p->plane->columns * p->plane->rows;
    for (size_t i = 0; i < cells; i++)
        count += p->state[i] != CELL_EMPTY;
    size_t total = mesh->triangle_count + 2 * count;
    mesh_reserve(mesh, 0, 2 * count);
    segments->of_triangle = mem_realloc_array(segments->of_triangle, total, sizeof *segments->of_triangle);
    for (uint32_t i = 0; i < cells; i++) {
        if (p->state[i] == CELL_EMPTY)
            continue;
        uint32_t a = p->vertex[corner_of(p, i, 0, 0)], b = p->vertex[corner_of(p, i, 1, 0)];
        uint32_t c = p->vertex[corner_of(p, i, 1, 1)], d = p->vertex[corner_of(p, i, 0, 1)];
        add_triangle(mesh, segments, a, b, c, pattern[p->region[i]]);
        add_triangle(mesh, segments, a, c, d, pattern[p->region[i]]);
    }
}

/* Marks the filled cells of a plane; false: there are none. */
static bool mark_filled(struct hole_patch *p) {
    bool any = false;
    for (uint32_t i = 0; i < p->plane->columns * p->plane->rows; i++) {
        p->region[i] = cell_of(p, i)->region;
        p->state[i] = p->region[i] != HOLE_NO_CELL ? CELL_FILLED : CELL_EMPTY;
        any |= p->state[i] == CELL_FILLED;
    }
    return any;
}

static void fill_plane(struct hole_patch *p, struct mesh *mesh, struct segments *segments,
                       const struct hole_regions *holes) {
    uint32_t *votes = mem_calloc(segments->count, sizeof *votes);
    uint32_t *pattern = mem_array(holes->count + 1, sizeof *pattern);
    close_unseen(p);
    go_behind(p);
    fix_corners(p);
    stretch(p);
    for (uint32_t k = 0; k < holes->count; k++)
        pattern[k] = hole_grid_plane(p->grid, holes->region[k].first_cell) == p->plane
                         ? pattern_of(p, segments, k, votes)
                         : ACCEL_NONE;
    add_vertices(p, mesh);
    add_triangles(p, mesh, segments, pattern);
    mem_free(pattern);
    mem_free(votes);
}

size_t hole_surface_add(struct mesh *mesh, struct segments *segments, const struct hole_grid *grid,
                        const struct hole_regions *holes) {
    size_t before = mesh->triangle_count;
    for (size_t k = 0; k < grid->plane_count; k++) {
        const struct hole_plane *plane = &grid->plane[k];
        size_t cells = (size_t)plane->columns * plane->rows;
        size_t corners = (size_t)(plane->columns + 1) * (plane->rows + 1);
        struct hole_patch p = {.grid = grid, .plane = plane};
        p.state = mem_calloc(cells, sizeof *p.state);
        p.region = mem_array(cells, sizeof *p.region);
        p.height_m = mem_array(corners, sizeof *p.height_m);
        p.is_fixed = mem_calloc(corners, sizeof *p.is_fixed);
        p.vertex = mem_array(corners, sizeof *p.vertex);
        if (mark_filled(&p))
            fill_plane(&p, mesh, segments, holes);
        mem_free(p.vertex);
        mem_free(p.is_fixed);
        mem_free(p.height_m);
        mem_free(p.region);
        mem_free(p.state);
    }
    return mesh->triangle_count - before;
}
