/* probes.h -- points of the surface at which incident light is gathered, and interpolation between them.
 *
 * Irradiance varies more slowly than texture, so it is gathered with many rays at few points: one for each chart in
 * each square cell of the atlas. Cells are blocks of equal size at first; where gathered light turns out to vary from
 * probe to probe (beside what touches the surface, in gaps) blocks are halved. Between probes light is interpolated
 * within a chart, from the 3 x 3 cells around, by distance in the atlas and similarity of normals. Probes that no
 * photograph sees (under a vase) hardly count for texels that one does. */
#ifndef UNBAKE_GATHER_PROBES_H
#define UNBAKE_GATHER_PROBES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/parallel.h"
#include "server/capture/fuse.h"
#include "server/gather/irradiance.h"
#include "server/scene/atlas.h"
#include "server/scene/inverse_uv.h"
#include "server/scene/mesh.h"

/* Texels a side of a block, for a texture of so many texels along its longer side: 8 of 2048 and in proportion, so that
 * blocks are as large on the surface whatever the texture; at least 4, since a block of fewer texels costs more than it
 * saves. */
#define PROBES_SPACING_AT_2048 8
#define PROBES_MIN_SPACING 4
static inline uint32_t probes_spacing(uint32_t side) {
    uint32_t spacing = side * PROBES_SPACING_AT_2048 / 2048;
    return spacing < PROBES_MIN_SPACING ? PROBES_MIN_SPACING : spacing;
}

struct probe {
    uint32_t texel, chart;
    bool seen;    /* a photograph sees the texel */
    vec3 shading; /* unit, interpolated normal there */
    struct irradiance light;
};

struct probes {
    uint32_t spacing;       /* texels a side of a block */
    uint32_t columns, rows; /* of blocks */
    uint8_t *halvings;      /* [columns * rows] a block has 1 << halvings cells a side; owned */
    uint32_t *first_cell;   /* [columns * rows + 1] of a block; owned */
    size_t count;
    struct probe *probe; /* [count] by block and cell, each row by row; owned */
    uint32_t *first;     /* [cells + 1] first probe of a cell; owned */
};

/* Index of the probe of a chart in the cell of texel (x, y); UINT32_MAX: none. */
uint32_t probes_at(const struct probes *p, uint32_t x, uint32_t y, uint32_t chart);

/* Texels a side of a block's cells. */
uint32_t probes_cell_side(const struct probes *p, size_t block);

/* Probes of a chart in the 3 x 3 cells around a texel of it, as large as its own: fewer than nine where cells there are
 * larger, or have none of the chart. */
#define PROBES_AROUND 9
struct probe_neighbours {
    size_t count;
    uint32_t probe[PROBES_AROUND];
};
void probes_neighbours(const struct probes *p, const struct fused *fused, uint32_t texel, uint32_t chart,
                       struct probe_neighbours *n);

/* How much two unit normals count as one: 1 if equal, a tenth at 40 degrees, 0 from 90 degrees on. */
float probes_likeness(vec3 a, vec3 b);

/* Interpolation weights of a texel; they sum to 1. */
struct probe_mix {
    size_t count; /* at least 1 for a valid texel */
    uint32_t probe[PROBES_AROUND];
    float weight[PROBES_AROUND];
};

/* Chooses the positions, one cell a block; light is 0. */
void probes_init(struct probes *p, uint32_t spacing, const struct mesh *mesh, const struct atlas *atlas,
                 const struct inverse_uv *inverse, const struct fused *fused);
/* Chooses them anew, by p->halvings. */
void probes_place(struct probes *p, const struct mesh *mesh, const struct atlas *atlas,
                  const struct inverse_uv *inverse, const struct fused *fused);
void probes_release(struct probes *p);

/* Gathers the light at probes [first, first + count) with `samples` directions each. */
void probes_gather(struct probes *p, const struct light_field *field, const struct mesh *mesh,
                   const struct atlas *atlas, const struct inverse_uv *inverse, uint64_t seed, size_t samples,
                   size_t first, size_t count, struct parallel *pool);

/* Interpolation weights for a valid texel; `at` is its surface point. */
void probes_mix(const struct probes *p, const struct atlas *atlas, const struct fused *fused, uint32_t texel,
                const struct surface_point *at, struct probe_mix *mix);
/* *out: the interpolated irradiance, by the weights of `mix`. */
void probes_irradiance(const struct probes *p, const struct probe_mix *mix, struct irradiance *out);

#endif
