/* hidden_holes.c -- see hidden_holes.h. */
#include "server/holes/hidden_holes.h"

#include <math.h>

#include "common/mem.h"

#define LEAST_CONTACT 2 /* cells of a region that are beside covered ones */
/* Planes behind which so little of the mesh's vertices lies, by more than a cell, end the room: window reveals are
 * behind a wall, another room is behind an inner one. */
#define MOST_BEHIND 0.05
#define PLACES 16  /* of a region, from which it is looked around */
#define LOOKS 16   /* rays from each */
#define FRONTS 0.1 /* of what they meet, at least: from outside all is backs, behind furniture much of it */

/* What a cell is to a hidden hole. */
enum { CELL_HIDDEN, CELL_SOLID, CELL_OPEN };

static const int way[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};

struct hidden_search {
    struct hole_grid *grid;
    size_t shown_count; /* holes that photographs show */
    bool ends_room[ROOM_PLANES_MAX];
    uint8_t *kind;      /* [cell_count] */
    uint8_t *is_closed; /* [cell_count] a bit for each way */
};

static uint8_t kind_of(const struct hole_cell *cell) {
    if (hole_cell_is_covered(cell) || cell->region != HOLE_NO_CELL)
        return CELL_SOLID;
    return cell->passed > 0 || cell->opened > 0 || cell->is_refused ? CELL_OPEN : CELL_HIDDEN;
}

static vec3 middle_of(const struct hole_grid *grid, const struct hole_plane *plane, uint32_t cell) {
    uint32_t number = cell - plane->first, column = number % plane->columns, row = number / plane->columns;
    return vec3_scale(
        vec3_add(hole_plane_corner(grid, plane, column, row), hole_plane_corner(grid, plane, column + 1, row + 1)),
        0.5f);
}

/* --- what is all around -------------------------------------------------------------------------- */

static bool ends_room(const struct hole_grid *grid, const struct room_plane *plane, const struct mesh *mesh) {
    size_t behind = 0;
    for (size_t i = 0; i < mesh->vertex_count; i++)
        behind += room_plane_height(plane, mesh->position[i]) < -grid->side_m;
    return (double)behind <= MOST_BEHIND * (double)mesh->vertex_count;
}

/* Whether the room ends between two places of a plane. */
static bool leaves_room(const struct hidden_search *s, const struct hole_plane *plane, vec3 from, vec3 to) {
    for (size_t k = 0; k < s->grid->plane_count; k++) {
        const struct hole_plane *other = &s->grid->plane[k];
        if (s->ends_room[k] && other != plane && room_plane_height(&other->plane, from) > 0.0f &&
            room_plane_height(&other->plane, to) <= 0.0f)
            return true;
    }
    return false;
}

/* From a hidden cell one way. The cell there must have been closed before. */
static bool is_closed(const struct hidden_search *s, const struct hole_plane *plane, uint32_t at, int k) {
    uint32_t next = hole_grid_neighbour(plane, at, way[k][0], way[k][1]);
    if (next == HOLE_NO_CELL || s->kind[next] == CELL_OPEN)
        return false;
    return s->kind[next] == CELL_SOLID || (s->is_closed[next] >> k & 1) != 0 ||
           leaves_room(s, plane, middle_of(s->grid, plane, at), middle_of(s->grid, plane, next));
}

/* Each way in the order in which the cell beyond comes first. */
static void close_plane(struct hidden_search *s, const struct hole_plane *plane) {
    uint32_t count = plane->columns * plane->rows;
    for (int k = 0; k < 4; k++) {
        for (uint32_t i = 0; i < count; i++) {
            uint32_t at = plane->first + (way[k][0] + way[k][1] > 0 ? count - 1 - i : i);
            if (s->kind[at] == CELL_HIDDEN && is_closed(s, plane, at, k))
                s->is_closed[at] |= (uint8_t)(1 << k);
        }
    }
}

/* --- regions ------------------------------------------------------------------------------------- */

static bool is_part(const struct hidden_search *s, uint32_t cell) {
    return s->kind[cell] == CELL_HIDDEN && s->is_closed[cell] == 15 && s->grid->cell[cell].region == HOLE_NO_CELL;
}

/* Marks the cells that are connected with `first` as region `number`, and lists them; *beside: a hole that photographs
 * show beside them, or HOLE_NO_CELL. Returns their number. */
static uint32_t flood(struct hidden_search *s, uint32_t first, uint32_t number, uint32_t *list, uint32_t *contact,
                      uint32_t *beside) {
    const struct hole_plane *plane = hole_grid_plane(s->grid, first);
    uint32_t count = 1;
    *contact = 0;
    *beside = HOLE_NO_CELL;
    list[0] = first;
    s->grid->cell[first].region = number;
    for (uint32_t i = 0; i < count; i++) {
        bool touches = false;
        for (int k = 0; k < 9; k++) {
            uint32_t n = hole_grid_neighbour(plane, list[i], k % 3 - 1, k / 3 - 1);
            if (n == HOLE_NO_CELL)
                continue;
            touches |= hole_cell_is_covered(&s->grid->cell[n]);
            if (s->grid->cell[n].region < s->shown_count)
                *beside = s->grid->cell[n].region;
            if (is_part(s, n)) {
                s->grid->cell[n].region = number;
                list[count++] = n;
            }
        }
        *contact += touches;
    }
    return count;
}

/* Whether fronts of the room are seen from a region. */
static bool is_inside(const struct hole_grid *grid, const struct mesh *mesh, const struct accel *accel,
                      const uint32_t *list, uint32_t count) {
    const struct hole_plane *plane = hole_grid_plane(grid, list[0]);
    vec3 normal = plane->plane.normal;
    double fronts = 0.0, all = 0.0;
    for (uint32_t i = 0; i < PLACES; i++) {
        vec3 from = vec3_mad(middle_of(grid, plane, list[(size_t)i * count / PLACES]), 0.5f * grid->side_m, normal);
        for (uint32_t k = 0; k < LOOKS; k++) {
            float z = ((float)k + 0.5f) / LOOKS, flat = sqrtf(1.0f - z * z), turn = 2.4f * (float)(k + LOOKS * i);
            vec3 direction = vec3_scale(normal, z);
            struct accel_hit hit;
            direction = vec3_mad(direction, flat * cosf(turn), plane->plane.s);
            direction = vec3_mad(direction, flat * sinf(turn), plane->plane.t);
            if (!accel_intersect(accel, from, direction, 0.0f, INFINITY, &hit))
                continue;
            all += 1.0;
            fronts += vec3_dot(mesh_cross(mesh, hit.triangle), direction) < 0.0f;
        }
    }
    return fronts > FRONTS * all;
}

/* All cells of a list become part of a region, or of none. */
static void assign(struct hole_grid *grid, const uint32_t *list, uint32_t count, uint32_t region) {
    for (uint32_t i = 0; i < count; i++)
        grid->cell[list[i]].region = region;
}

/* Takes up the region around a cell: as a part of the hole beside it, as one of its own, or not. list[cell_count]. */
static void take_region(struct hidden_search *s, struct hole_regions *holes, uint32_t first, const struct mesh *mesh,
                        const struct accel *accel, uint32_t *list) {
    struct hole_region region = {.first_cell = first, .is_hole = true, .is_hidden = true};
    uint32_t beside;
    region.cells = flood(s, first, (uint32_t)holes->count, list, &region.contact, &beside);
    if (beside != HOLE_NO_CELL) {
        assign(s->grid, list, region.cells, beside);
        holes->region[beside].cells += region.cells;
    } else if (region.contact >= LEAST_CONTACT && is_inside(s->grid, mesh, accel, list, region.cells)) {
        holes->region = mem_realloc_array(holes->region, holes->count + 1, sizeof *holes->region);
        holes->region[holes->count++] = region;
    } else {
        assign(s->grid, list, region.cells, HOLE_NO_CELL);
        for (uint32_t i = 0; i < region.cells; i++)
            s->kind[list[i]] = CELL_OPEN;
    }
}

void hidden_holes_add(struct hole_regions *holes, struct hole_grid *grid, const struct mesh *mesh,
                      const struct accel *accel) {
    struct hidden_search s = {.grid = grid,
                              .shown_count = holes->count,
                              .kind = mem_array(grid->cell_count + 1, sizeof *s.kind),
                              .is_closed = mem_calloc(grid->cell_count + 1, sizeof *s.is_closed)};
    uint32_t *list = mem_array(grid->cell_count + 1, sizeof *list);
    for (uint32_t i = 0; i < grid->cell_count; i++)
        s.kind[i] = kind_of(&grid->cell[i]);
    for (size_t k = 0; k < grid->plane_count; k++)
        s.ends_room[k] = ends_room(grid, &grid->plane[k].plane, mesh);
    for (size_t k = 0; k < grid->plane_count; k++)
        close_plane(&s, &grid->plane[k]);
    for (uint32_t i = 0; i < grid->cell_count; i++)
        if (is_part(&s, i))
            take_region(&s, holes, i, mesh, accel, list);
    mem_free(list);
    mem_free(s.is_closed);
    mem_free(s.kind);
}
