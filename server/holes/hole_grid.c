/* hole_grid.c -- see hole_grid.h. */
#include "server/holes/hole_grid.h"

#include "common/mem.h"

/* Side of a cell as a share of the room's diagonal: 4 cm in a room of 5 x 4 x 2.5 m, a few pixels of a photograph. */
#define SIDE_SHARE (1.0f / 160.0f)
/* How far off its plane the points lie that a plane is fitted to; how far a surface that covers a cell; in cells. */
#define FIT_CELLS 0.15f
#define REACH_CELLS 0.5f
/* How far planes go on beyond what was scanned, as a share of its extent: scanners reach 5 to 6 m, halls are 15 m
 * long. */
#define BEYOND 0.5f

static void place_cells(struct hole_grid *grid, struct hole_plane *p, vec3 lower, vec3 upper) {
    float least[2] = {INFINITY, INFINITY}, most[2] = {-INFINITY, -INFINITY};
    for (int i = 0; i < 8; i++) {
        vec3 corner = {i & 1 ? upper.x : lower.x, i & 2 ? upper.y : lower.y, i & 4 ? upper.z : lower.z};
        vec3 at = vec3_sub(corner, p->plane.origin);
        float place[2] = {vec3_dot(at, p->plane.s), vec3_dot(at, p->plane.t)};
        for (int k = 0; k < 2; k++) {
            least[k] = fminf(least[k], place[k]);
            most[k] = fmaxf(most[k], place[k]);
        }
    }
    p->s_m = least[0];
    p->t_m = least[1];
    p->columns = (uint32_t)ceilf((most[0] - least[0]) / grid->side_m);
    p->rows = (uint32_t)ceilf((most[1] - least[1]) / grid->side_m);
    p->first = grid->cell_count;
    grid->cell_count += p->columns * p->rows;
}

vec3 hole_plane_corner(const struct hole_grid *grid, const struct hole_plane *p, uint32_t column, uint32_t row) {
    vec3 at = vec3_mad(p->plane.origin, p->s_m + (float)column * grid->side_m, p->plane.s);
    return vec3_mad(at, p->t_m + (float)row * grid->side_m, p->plane.t);
}

struct cover_job {
    struct hole_grid *grid;
    const struct mesh *mesh;
    const struct accel *accel;
};

/* Looks for the mesh along the normal through the middle of a cell; a surface that turns away from it does not
 * count. */
static void cover_cell(const struct cover_job *job, const struct hole_plane *p, uint32_t number) {
    struct hole_cell *cell = &job->grid->cell[p->first + number];
    uint32_t column = number % p->columns, row = number / p->columns;
    float reach = REACH_CELLS * job->grid->side_m;
    vec3 middle = vec3_scale(
        vec3_add(hole_plane_corner(job->grid, p, column, row), hole_plane_corner(job->grid, p, column + 1, row + 1)),
        0.5f);
    struct accel_hit hit;
    cell->triangle = ACCEL_NONE;
    cell->region = HOLE_NO_CELL;
    if (!accel_intersect(job->accel, vec3_mad(middle, reach, p->plane.normal), vec3_neg(p->plane.normal), 0.0f,
                         2.0f * reach, &hit) ||
        vec3_dot(mesh_cross(job->mesh, hit.triangle), p->plane.normal) <= 0.0f)
        return;
    cell->triangle = hit.triangle;
    cell->height_m = reach - hit.distance_m;
}

static void cover_row(void *user, size_t index, int thread) {
    const struct cover_job *job = user;
    size_t k = 0;
    (void)thread;
    while (index >= job->grid->plane[k].rows)
        index -= job->grid->plane[k++].rows;
    const struct hole_plane *p = &job->grid->plane[k];
    for (uint32_t column = 0; column < p->columns; column++)
        cover_cell(job, p, (uint32_t)index * p->columns + column);
}

/* The room's extent, and what lies BEYOND it, but no more than what is asked for. */
static void find_bounds(const struct mesh *mesh, const vec3 within[2], vec3 *lower, vec3 *upper) {
    mesh_bounds(mesh, lower, upper);
    vec3 size = vec3_sub(*upper, *lower);
    *lower = vec3_mad(*lower, -BEYOND, size);
    *upper = vec3_mad(*upper, BEYOND, size);
    if (!within)
        return;
    *lower = (vec3){fmaxf(lower->x, within[0].x), fmaxf(lower->y, within[0].y), fmaxf(lower->z, within[0].z)};
    *upper = (vec3){fminf(upper->x, within[1].x), fminf(upper->y, within[1].y), fminf(upper->z, within[1].z)};
}

void hole_grid_init(struct hole_grid *grid, const struct mesh *mesh, const struct accel *accel, const vec3 within[2],
                    struct parallel *pool) {
    struct room_plane plane[ROOM_PLANES_MAX];
    vec3 lower, upper;
    size_t rows = 0;
    mesh_bounds(mesh, &lower, &upper);
    *grid = (struct hole_grid){.side_m = SIDE_SHARE * vec3_length(vec3_sub(upper, lower))};
    grid->plane_count = room_planes_find(mesh, FIT_CELLS * grid->side_m, plane);
    find_bounds(mesh, within, &lower, &upper);
    for (size_t k = 0; k < grid->plane_count; k++) {
        grid->plane[k].plane = plane[k];
        place_cells(grid, &grid->plane[k], lower, upper);
        rows += grid->plane[k].rows;
    }
    grid->cell = mem_calloc(grid->cell_count + 1, sizeof *grid->cell);
    parallel_for(pool, rows, cover_row, &(struct cover_job){grid, mesh, accel});
}

void hole_grid_release(struct hole_grid *grid) {
    mem_free(grid->cell);
    *grid = (struct hole_grid){0};
}

uint32_t hole_grid_meet(const struct hole_grid *grid, size_t number, vec3 origin, vec3 direction, float *distance_m) {
    const struct hole_plane *p = &grid->plane[number];
    float height = room_plane_height(&p->plane, origin), slope = vec3_dot(p->plane.normal, direction);
    if (!(height > 0.0f) || !(slope < 0.0f))
        return HOLE_NO_CELL;
    *distance_m = -height / slope;
    vec3 at = vec3_sub(vec3_mad(origin, *distance_m, direction), p->plane.origin);
    float column = floorf((vec3_dot(at, p->plane.s) - p->s_m) / grid->side_m);
    float row = floorf((vec3_dot(at, p->plane.t) - p->t_m) / grid->side_m);
    if (!(column >= 0.0f && row >= 0.0f && column < (float)p->columns && row < (float)p->rows))
        return HOLE_NO_CELL;
    return p->first + (uint32_t)row * p->columns + (uint32_t)column;
}

const struct hole_plane *hole_grid_plane(const struct hole_grid *grid, uint32_t cell) {
    size_t k = 0;
    while (k + 1 < grid->plane_count && cell >= grid->plane[k + 1].first)
        k++;
    return &grid->plane[k];
}

uint32_t hole_grid_neighbour(const struct hole_plane *p, uint32_t cell, int columns, int rows) {
    int64_t column = (int64_t)((cell - p->first) % p->columns) + columns;
    int64_t row = (int64_t)((cell - p->first) / p->columns) + rows;
    if (column < 0 || row < 0 || column >= p->columns || row >= p->rows)
        return HOLE_NO_CELL;
    return p->first + (uint32_t)row * p->columns + (uint32_t)column;
}
