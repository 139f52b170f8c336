/* hole_regions.c -- see hole_regions.h. */
#include "server/holes/hole_regions.h"

#include <string.h>

#include "common/mem.h"
#include "server/holes/hole_evidence.h"

#define ROUNDS 200 /* at most: each refuses cells, and observations go on to the next plane */
/* Rays that pass a cell, per ray that meets nothing in it, from which on no surface is there: edges of the mesh are
 * ragged, so that some pass. */
#define MOST_PASSED 0.25
#define LEAST_FREEDOM 4.0 /* of such a variance */
#define LEAST_CONTACT 2   /* cells of a region that are beside covered ones */

static bool is_open(const struct hole_cell *cell) { return cell->opened > 0 && !cell->is_refused; }

/* Refuses what rays pass; true where anything was. */
static bool refuse_passed(struct hole_grid *grid) {
    bool any = false;
    for (uint32_t i = 0; i < grid->cell_count; i++) {
        struct hole_cell *cell = &grid->cell[i];
        if (is_open(cell) && (double)cell->passed * HOLE_PASS_STRIDE * HOLE_PASS_STRIDE > MOST_PASSED * cell->opened)
            any = cell->is_refused = true;
    }
    return any;
}

/* Scatter of a cell and its neighbours. */
static struct hole_scatter scatter_around(const struct hole_grid *grid, const struct hole_plane *plane, uint32_t at) {
    struct hole_scatter sum = {0};
    for (int k = 0; k < 9; k++) {
        uint32_t n = hole_grid_neighbour(plane, at, k % 3 - 1, k / 3 - 1);
        if (n != HOLE_NO_CELL && is_open(&grid->cell[n]) && grid->cell[n].open.photographs > 1) {
            sum.variance += hole_mean_scatter(&grid->cell[n].open);
            sum.freedom += grid->cell[n].open.photographs - 1;
        }
    }
    sum.variance /= fmax(sum.freedom, 1.0);
    return sum;
}

/* Whether the mesh covers a cell of the 5 x 5 around. */
static bool is_beside_surface(const struct hole_grid *grid, const struct hole_plane *plane, uint32_t at) {
    bool any = false;
    for (int k = 0; k < 25; k++) {
        uint32_t n = hole_grid_neighbour(plane, at, k % 5 - 2, k / 5 - 2);
        any |= n != HOLE_NO_CELL && hole_cell_is_covered(&grid->cell[n]);
    }
    return any;
}

/* Refuses cells about which photographs disagree, and those away from the mesh that only one shows; true where any
 * was. */
static bool refuse_scattered(struct hole_grid *grid) {
    bool any = false, *is_bad = mem_calloc(grid->cell_count + 1, sizeof *is_bad);
    for (size_t k = 0; k < grid->plane_count; k++) {
        const struct hole_plane *plane = &grid->plane[k];
        double most = HOLE_MOST_VARIANCE * plane->variance;
        for (uint32_t i = plane->first; i < plane->first + plane->columns * plane->rows; i++) {
            if (!is_open(&grid->cell[i]))
                continue;
            struct hole_scatter around = scatter_around(grid, plane, i);
            is_bad[i] = (around.freedom >= LEAST_FREEDOM && around.variance > most) ||
                        (around.freedom == 0.0 && !is_beside_surface(grid, plane, i));
        }
    }
    for (uint32_t i = 0; i < grid->cell_count; i++) {
        any |= is_bad[i];
        grid->cell[i].is_refused |= is_bad[i];
    }
    mem_free(is_bad);
    return any;
}

/* Marks the cells that are connected with `first` as region `number`. stack[cell_count]. */
static void flood(struct hole_grid *grid, uint32_t first, uint32_t number, uint32_t *stack,
                  struct hole_region *region) {
    const struct hole_plane *plane = hole_grid_plane(grid, first);
    size_t depth = 0;
    *region = (struct hole_region){.first_cell = first};
    stack[depth++] = first;
    grid->cell[first].region = number;
    while (depth > 0) {
        uint32_t at = stack[--depth];
        bool is_rim = false, touches = hole_cell_is_covered(&grid->cell[at]);
        region->cells++;
        region->observations += grid->cell[at].opened;
        for (int k = 0; k < 9; k++) {
            uint32_t n = hole_grid_neighbour(plane, at, k % 3 - 1, k / 3 - 1);
            if (n == HOLE_NO_CELL || !is_open(&grid->cell[n])) {
                is_rim = true;
                touches |= n != HOLE_NO_CELL && hole_cell_is_covered(&grid->cell[n]);
            } else if (grid->cell[n].region == HOLE_NO_CELL) {
                grid->cell[n].region = number;
                stack[depth++] = n;
            }
        }
        region->rim += is_rim || touches;
        region->contact += touches;
    }
}

static void find_regions(struct hole_regions *regions, struct hole_grid *grid) {
    size_t capacity = 0;
    uint32_t *stack = mem_array(grid->cell_count + 1, sizeof *stack);
    *regions = (struct hole_regions){0};
    for (uint32_t i = 0; i < grid->cell_count; i++)
        grid->cell[i].region = HOLE_NO_CELL;
    for (uint32_t i = 0; i < grid->cell_count; i++) {
        if (!is_open(&grid->cell[i]) || grid->cell[i].region != HOLE_NO_CELL)
            continue;
        if (regions->count == capacity) {
            capacity = 2 * capacity + 64;
            regions->region = mem_realloc_array(regions->region, capacity, sizeof *regions->region);
        }
        flood(grid, i, (uint32_t)regions->count, stack, &regions->region[regions->count]);
        regions->count++;
    }
    mem_free(stack);
}

/* Refuses regions that touch no surface, and, where `decides`, those that are openings. True where any was. */
static bool refuse_regions(struct hole_regions *regions, struct hole_grid *grid,
                           const struct hole_observations *observations, bool decides) {
    bool any = false;
    find_regions(regions, grid);
    if (decides)
        hole_evidence_find(regions, grid, observations);
    for (uint32_t i = 0; i < grid->cell_count; i++) {
        struct hole_cell *cell = &grid->cell[i];
        if (cell->region == HOLE_NO_CELL)
            continue;
        const struct hole_region *region = &regions->region[cell->region];
        if (region->contact < LEAST_CONTACT || (decides && !region->is_hole))
            any = cell->is_refused = true;
    }
    return any;
}

/* Refuses, until all that are left touch the mesh and no ray passes them; where `decides`, until all are holes. */
static void refuse(struct hole_regions *regions, struct hole_grid *grid, struct hole_observations *observations,
                   bool decides) {
    bool any = true;
    for (int round = 0; round < ROUNDS && any; round++) {
        hole_observations_assign(observations, grid);
        any = refuse_passed(grid) || (decides && refuse_scattered(grid));
        for (int step = 0; step < (decides ? 2 : 1) && !any; step++) {
            hole_regions_release(regions);
            any = refuse_regions(regions, grid, observations, step == 1);
        }
    }
}

/* Keeps of `candidates` those that are mostly not holes. of[cell_count]: the candidate that a cell is part of. */
static void find_kept(struct hole_regions *kept, const struct hole_regions *candidates, const struct hole_grid *grid,
                      const uint32_t *of) {
    uint32_t *filled = mem_calloc(candidates->count + 1, sizeof *filled);
    for (uint32_t i = 0; i < grid->cell_count; i++) {
        if (of[i] != HOLE_NO_CELL && grid->cell[i].region != HOLE_NO_CELL)
            filled[of[i]]++;
    }
    *kept = (struct hole_regions){.region = mem_array(candidates->count + 1, sizeof *kept->region)};
    for (size_t k = 0; k < candidates->count; k++) {
        if (2 * filled[k] < candidates->region[k].cells)
            kept->region[kept->count++] = candidates->region[k];
    }
    mem_free(filled);
}

void hole_regions_find(struct hole_regions *holes, struct hole_regions *kept, struct hole_grid *grid,
                       struct hole_observations *observations, bool fills_all) {
    struct hole_regions candidates = {0};
    uint32_t *of = mem_array(grid->cell_count + 1, sizeof *of);
    *holes = *kept = (struct hole_regions){0};
    refuse(&candidates, grid, observations, false);
    hole_evidence_find(&candidates, grid, observations);
    for (uint32_t i = 0; i < grid->cell_count; i++)
        of[i] = grid->cell[i].region;
    if (fills_all) {
        *holes = candidates;
    } else {
        refuse(holes, grid, observations, true);
        find_kept(kept, &candidates, grid, of);
        hole_regions_release(&candidates);
    }
    mem_free(of);
}

void hole_regions_release(struct hole_regions *regions) {
    mem_free(regions->region);
    *regions = (struct hole_regions){0};
}
