/* hole_grid.h -- cells on a room's planes, and what photographs show of each.
 *
 * Each plane is cut into square cells, over the room's extent and half of it to each side. A cell is covered where the
 * mesh lies in it. It is passed by a ray that goes through it and meets the mesh behind, or nothing but darkness: there
 * is no surface. Means of log radiance are over photographs: each counts once, with the mean of its pixels. */
#ifndef UNBAKE_HOLES_HOLE_GRID_H
#define UNBAKE_HOLES_HOLE_GRID_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/parallel.h"
#include "server/holes/room_planes.h"
#include "server/render/accel.h"

#define HOLE_NO_CELL UINT32_MAX

/* Log radiance by photograph. */
struct hole_mean {
    float sum, squares; /* of the photographs' means, less `first`, which keeps the sums small */
    float first;        /* of the first photograph */
    float now;          /* sum over pixels of the photograph that is being added */
    uint32_t now_pixels;
    uint32_t photographs;
};

struct hole_cell {
    struct hole_mean surface, open; /* what is seen of the mesh in it; through it, where nothing is met */
    uint32_t passed;                /* rays */
    uint32_t opened;                /* rays that meet nothing, the bright ones */
    uint32_t triangle;              /* of the mesh, in the middle of the cell; ACCEL_NONE: not covered */
    float height_m;                 /* of that triangle over the plane */
    uint32_t region;                /* that the cell is part of, or HOLE_NO_CELL */
    bool is_refused;                /* no surface is to be there */
};

struct hole_plane {
    struct room_plane plane;
    float s_m, t_m; /* of the first cell's corner */
    uint32_t columns, rows;
    uint32_t first;  /* number of its first cell */
    double variance; /* of log radiance among the photographs of what covers a cell; set by hole_observations_take */
};

struct hole_grid {
    float side_m; /* of a cell */
    size_t plane_count;
    struct hole_plane plane[ROOM_PLANES_MAX];
    uint32_t cell_count;
    struct hole_cell *cell; /* [cell_count] plane after plane, row after row; owned */
};

/* Finds planes, and which of their cells the mesh covers. within: the box that cells lie in, lower and upper corner;
 * NULL: any. */
void hole_grid_init(struct hole_grid *grid, const struct mesh *mesh, const struct accel *accel, const vec3 within[2],
                    struct parallel *pool);
void hole_grid_release(struct hole_grid *grid);

/* The cell of plane `number` that a ray meets from the front and its distance; HOLE_NO_CELL: none. */
uint32_t hole_grid_meet(const struct hole_grid *grid, size_t number, vec3 origin, vec3 direction, float *distance_m);

/* The plane of a cell, and its neighbour by (column, row); HOLE_NO_CELL beyond the plane's cells. */
const struct hole_plane *hole_grid_plane(const struct hole_grid *grid, uint32_t cell);
uint32_t hole_grid_neighbour(const struct hole_plane *plane, uint32_t cell, int columns, int rows);

/* Point of the plane at a corner of cells. */
vec3 hole_plane_corner(const struct hole_grid *grid, const struct hole_plane *plane, uint32_t column, uint32_t row);

static inline bool hole_cell_is_covered(const struct hole_cell *cell) { return cell->triangle != ACCEL_NONE; }

/* Adds a pixel of the current photograph; ends it. */
static inline void hole_mean_add(struct hole_mean *m, float value) {
    m->now += value;
    m->now_pixels++;
}
static inline void hole_mean_close(struct hole_mean *m) {
    if (m->now_pixels == 0)
        return;
    float mean = m->now / (float)m->now_pixels;
    if (m->photographs++ == 0)
        m->first = mean;
    m->sum += mean - m->first;
    m->squares += (mean - m->first) * (mean - m->first);
    m->now = 0.0f;
    m->now_pixels = 0;
}
static inline double hole_mean_value(const struct hole_mean *m) {
    return m->photographs > 0 ? (double)m->first + (double)m->sum / m->photographs : 0.0;
}
/* Sum of the photographs' squared deviations from the mean; its degrees of freedom are photographs - 1. */
static inline double hole_mean_scatter(const struct hole_mean *m) {
    return m->photographs > 1 ? fmax(0.0, (double)m->squares - (double)m->sum * (double)m->sum / m->photographs) : 0.0;
}

#endif
