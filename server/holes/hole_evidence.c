/* hole_evidence.c -- see hole_evidence.h. */
#include "server/holes/hole_evidence.h"

#include <string.h>

#include "common/mem.h"
#include "common/quantile.h"

/* Cells of directions: bounds of the angle, radians (half a pixel of a wide lens; a hand's breadth at a metre). */
#define LEAST_ANGLE 0.003f
#define MOST_ANGLE 0.1f

#define LEAST_FREEDOM 8.0 /* of variances that are compared */
#define SURE 3.0          /* standard errors of the logarithm of their ratio */
#define LEAST_STEPS 8     /* pairs of cells across the rim */
#define MOST_STEP 1.5     /* across the rim, by that beside it */
#define FREE_STEP 0.05    /* logarithm: no step of a lamp or of sky is as small */
#define MOST_SATURATED 0.5

/* --- by direction --------------------------------------------------------------------------------- */

/* Scatter of a region's observations within cells of directions about as wide as its own cells appear. */
static struct hole_scatter scatter_away(const struct hole_observations *observations, const size_t *number,
                                        size_t count, float angle) {
    uint32_t columns = (uint32_t)ceilf(2.0f * (float)PI / angle), rows = (uint32_t)ceilf((float)PI / angle);
    struct hole_mean *mean = mem_calloc((size_t)columns * rows, sizeof *mean);
    uint32_t *at = mem_array(count + 1, sizeof *at);
    struct hole_scatter sum = {0};
    for (size_t i = 0, end; i < count; i = end) {
        for (end = i; end < count && observations->item[number[end]].train == observations->item[number[i]].train;
             end++) {
            const struct hole_observation *l = &observations->item[number[end]];
            float u = (atan2f(l->direction.x, l->direction.z) + (float)PI) / angle;
            float v = acosf(clampf(l->direction.y, -1.0f, 1.0f)) / angle;
            uint32_t column = (uint32_t)u < columns ? (uint32_t)u : columns - 1;
            uint32_t row = (uint32_t)v < rows ? (uint32_t)v : rows - 1;
            at[end] = row * columns + column;
            if (!l->is_saturated)
                hole_mean_add(&mean[at[end]], l->value);
        }
        for (size_t k = i; k < end; k++)
            hole_mean_close(&mean[at[k]]);
    }
    for (size_t i = 0; i < (size_t)columns * rows; i++) {
        sum.variance += hole_mean_scatter(&mean[i]);
        sum.freedom += mean[i].photographs > 1 ? mean[i].photographs - 1 : 0;
    }
    sum.variance /= fmax(sum.freedom, 1.0);
    mem_free(at);
    mem_free(mean);
    return sum;
}

/* Angle under which an observation sees its cell: the root of the solid angle. */
static float angle_of(const struct hole_grid *grid, const struct hole_observations *observations,
                      const struct hole_observation *observation) {
    const struct room_plane *plane = &hole_grid_plane(grid, observation->cell)->plane;
    float height = room_plane_height(plane, hole_observation_origin(observations, observation));
    float cosine = -vec3_dot(plane->normal, observation->direction);
    return grid->side_m * sqrtf(cosine) * cosine / height;
}

/* --- by place ------------------------------------------------------------------------------------- */

static void add_here(struct hole_region *region, const struct hole_cell *cell) {
    region->here.variance += hole_mean_scatter(&cell->open);
    region->here.freedom += cell->open.photographs > 1 ? cell->open.photographs - 1 : 0;
}

/* --- across the rim ------------------------------------------------------------------------------- */

struct hole_steps {
    float *across, *beside; /* [capacity] */
    size_t across_count, beside_count;
};

/* The cell two steps away, if the mesh is seen in it; else NULL. */
static const struct hole_cell *seen_surface(const struct hole_grid *grid, const struct hole_plane *plane, uint32_t at,
                                            int columns, int rows) {
    uint32_t n = hole_grid_neighbour(plane, at, columns, rows);
    const struct hole_cell *cell = n == HOLE_NO_CELL ? NULL : &grid->cell[n];
    return cell && hole_cell_is_covered(cell) && cell->surface.photographs > 0 && cell->opened == 0 ? cell : NULL;
}

/* Steps from a cell of the region to covered ones two cells away, and from these to those two cells farther. */
static void add_steps(struct hole_steps *steps, const struct hole_grid *grid, const struct hole_plane *plane,
                      uint32_t at) {
    static const int way[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
    double own = hole_mean_value(&grid->cell[at].open);
    for (int k = 0; k < 4; k++) {
        const struct hole_cell *next = seen_surface(grid, plane, at, 2 * way[k][0], 2 * way[k][1]);
        const struct hole_cell *after = seen_surface(grid, plane, at, 4 * way[k][0], 4 * way[k][1]);
        if (next && grid->cell[at].open.photographs > 0)
            steps->across[steps->across_count++] = (float)fabs(hole_mean_value(&next->surface) - own);
        if (next && after)
            steps->beside[steps->beside_count++] =
                (float)fabs(hole_mean_value(&after->surface) - hole_mean_value(&next->surface));
    }
}

/* --- the whole ------------------------------------------------------------------------------------ */

static bool decide(const struct hole_region *r, size_t steps) {
    if (r->saturated > MOST_SATURATED)
        return false;
    double here = fmax(r->here.variance, HOLE_LEAST_VARIANCE);
    double away = fmax(r->away.variance, HOLE_LEAST_VARIANCE);
    bool can_tell = r->here.freedom >= LEAST_FREEDOM && r->away.freedom >= LEAST_FREEDOM;
    double error = can_tell ? sqrt(2.0 / r->here.freedom + 2.0 / r->away.freedom) : INFINITY;
    bool agrees = here <= HOLE_MOST_VARIANCE * r->beside;
    if (can_tell && log(away / here) > SURE * error)
        return agrees;
    if (can_tell && log(here / away) > SURE * error)
        return false;
    return agrees && steps >= LEAST_STEPS && r->step <= fmax(MOST_STEP * r->usual_step, FREE_STEP);
}

/* own[count]: numbers of the region's observations. */
static void judge(struct hole_region *region, uint32_t number, const struct hole_grid *grid,
                  const struct hole_observations *observations, const size_t *own, size_t count) {
    const struct hole_plane *plane = hole_grid_plane(grid, region->first_cell);
    struct hole_steps steps = {mem_array(4 * (size_t)region->cells, sizeof(float)),
                               mem_array(4 * (size_t)region->cells, sizeof(float)), 0, 0};
    float *angle = mem_array(count + 1, sizeof *angle);
    size_t saturated = 0;
    region->here = (struct hole_scatter){0};
    for (uint32_t i = plane->first; i < plane->first + plane->columns * plane->rows; i++) {
        if (grid->cell[i].region != number)
            continue;
        add_here(region, &grid->cell[i]);
        add_steps(&steps, grid, plane, i);
    }
    region->here.variance /= fmax(region->here.freedom, 1.0);
    for (size_t i = 0; i < count; i++) {
        angle[i] = angle_of(grid, observations, &observations->item[own[i]]);
        saturated += observations->item[own[i]].is_saturated;
    }
    region->saturated = (double)saturated / fmax((double)count, 1.0);
    region->away = scatter_away(observations, own, count, clampf(quantile(angle, count, 0.5), LEAST_ANGLE, MOST_ANGLE));
    region->beside = plane->variance;
    size_t across = steps.across_count;
    region->step = (double)quantile(steps.across, steps.across_count, 0.5);
    region->usual_step = (double)quantile(steps.beside, steps.beside_count, 0.5);
    region->is_hole = decide(region, across);
    mem_free(angle);
    mem_free(steps.beside);
    mem_free(steps.across);
}

void hole_evidence_find(struct hole_regions *regions, const struct hole_grid *grid,
                        const struct hole_observations *observations) {
    size_t *start = mem_calloc(regions->count + 2, sizeof *start),
           *number = mem_array(observations->count + 1, sizeof *number);
    for (int pass = 0; pass < 2; pass++) {
        for (size_t i = 0; i < observations->count; i++) {
            uint32_t cell = observations->item[i].cell;
            uint32_t region = cell == HOLE_NO_CELL ? HOLE_NO_CELL : grid->cell[cell].region;
            if (region == HOLE_NO_CELL)
                continue;
            if (pass == 0)
                start[region + 2]++;
            else
                number[start[region + 1]++] = i;
        }
        for (size_t k = 0; k < regions->count && pass == 0; k++)
            start[k + 2] += start[k + 1];
    }
    for (size_t k = 0; k < regions->count; k++)
        judge(&regions->region[k], (uint32_t)k, grid, observations, number + start[k], start[k + 1] - start[k]);
    mem_free(number);
    mem_free(start);
}
