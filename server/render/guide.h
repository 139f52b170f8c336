/* guide.h -- light sampling by position: which emitters light which parts of a room.
 *
 * Sampling by power alone wastes most light samples on walls and on the back of lights. Emitters are divided into
 * patches and space into cells, each with six sides for surface orientation. For each cell and side that contains
 * surface (a row), the light from each patch is estimated once with a few shadow rays. Light samples follow the
 * estimates of their row; a fraction follows power, so light that the rays missed is still sampled. A guide only
 * changes the density of samples and never the result's expectation.
 *
 * A patch is a run of light triangles (light.h), within which power decides. A guide depends only on geometry and on
 * which segments emit, its rows also on how much: the same after a resume. */
#ifndef UNBAKE_RENDER_GUIDE_H
#define UNBAKE_RENDER_GUIDE_H

#include <stddef.h>
#include <stdint.h>

#include "common/parallel.h"
#include "common/vec.h"
#include "server/render/accel.h"
#include "server/render/light.h"
#include "server/scene/mesh.h"

/* Cells are cubes, numbered with x fastest; within a cell the six sides are +x, -x, +y, ... */
struct guide_grid {
    vec3 origin;
    float cells_per_m;
    int32_t size[3];
};

struct guide {
    struct guide_grid grid;
    uint16_t *row; /* [cells * 6] 0 where no surface was found; owned, as all below */
    size_t row_count, patch_count;
    uint32_t *first;              /* [patch_count + 1] index of the first light triangle */
    uint16_t *patch_of;           /* [light triangles] */
    float *transfer;              /* [row_count][patch_count] irradiance per unit radiance, root mean square over
                                  * points */
    float *power;                 /* [patch_count] share of the total power */
    size_t stride;                /* patch_count rounded up to a power of two */
    float *cumulative;            /* [row_count][stride] cumulative probability of the patches, padded with 1, then
                               * INFINITY; row 0 is by power */
    int32_t row_step, patch_step; /* first step of the binary searches in a row and in a patch (shade_pick) */
};

/* NULL when there are too many patches for a guide to pay off. */
struct guide *guide_new(const struct lights *lights, const struct mesh *mesh, const struct accel *accel,
                        struct parallel *pool);
void guide_free(struct guide *guide);

/* Takes over changed radiances of the lights that the guide was made for. */
void guide_update(struct guide *guide, const struct lights *lights);

/* Index of the cell and side of a point, for grid->row. */
static inline int32_t guide_cell(const struct guide_grid *grid, vec3 p, vec3 normal) {
    float fx = (p.x - grid->origin.x) * grid->cells_per_m;
    float fy = (p.y - grid->origin.y) * grid->cells_per_m;
    float fz = (p.z - grid->origin.z) * grid->cells_per_m;
    int32_t x = (int32_t)fx, y = (int32_t)fy, z = (int32_t)fz;
    x = x < 0 ? 0 : x < grid->size[0] ? x : grid->size[0] - 1;
    y = y < 0 ? 0 : y < grid->size[1] ? y : grid->size[1] - 1;
    z = z < 0 ? 0 : z < grid->size[2] ? z : grid->size[2] - 1;
    float ax = normal.x < 0.0f ? -normal.x : normal.x;
    float ay = normal.y < 0.0f ? -normal.y : normal.y;
    float az = normal.z < 0.0f ? -normal.z : normal.z;
    int32_t of_x = normal.x < 0.0f ? 1 : 0, of_y = normal.y < 0.0f ? 3 : 2, of_z = normal.z < 0.0f ? 5 : 4;
    int32_t across = ax > ay ? of_x : of_y;
    int32_t side = az > (ax > ay ? ax : ay) ? of_z : across;
    return ((z * grid->size[1] + y) * grid->size[0] + x) * 6 + side;
}

static inline float guide_chance(const struct guide *g, size_t row, size_t patch) {
    const float *c = g->cumulative + row * g->stride + patch;
    return patch > 0 ? c[0] - c[-1] : c[0];
}

/* Density of sampling points of light triangle `entry`, relative to sampling by power. */
static inline float guide_density_factor(const struct guide *g, size_t row, uint32_t entry) {
    size_t patch = g->patch_of[entry];
    return guide_chance(g, row, patch) / g->power[patch];
}

#endif
