/* correction.h -- the smooth factors by which refine corrects base colour.
 *
 * Errors that solve leaves are those of light, which vary slowly along a surface. Each cell, the part of a chart in one
 * block of the atlas, sums observed and rendered radiance; their ratio is the factor by which its base colour must
 * change (to first order a surface's radiance is its base colour times its light). A single observation is off by a
 * third, so the logarithms of the factors are the maximum a posteriori of a Gaussian Markov random field
 * (markov_field.h): they are near 0, and near those of the neighbouring cells of the chart. Changes of tint have a
 * narrower prior than changes of lightness. Factors are interpolated between the centres of cells; texture within a
 * cell stays.
 *
 * The noise of a cell is measured on its observations; channels are weighted by the noise of all photographs (noise.h).
 * No factor changes base colour by more than a tenth: anything more is light that the renders lack or have too much
 * of. */
#ifndef UNBAKE_REFINE_CORRECTION_H
#define UNBAKE_REFINE_CORRECTION_H

#include <stddef.h>
#include <stdint.h>

#include "common/parallel.h"
#include "server/capture/fuse.h"
#include "server/refine/comparison.h"
#include "server/refine/markov_field.h"
#include "server/scene/inverse_uv.h"
#include "server/scene/texture.h"

/* Lightness, common to all channels, and tint, the channels' differences from it. */
enum { CORRECTION_GRAY, CORRECTION_TINT, CORRECTION_KINDS };

/* Sums over the observations of a cell. */
struct correction_sums {
    float weight[3];                 /* at most 1 an observation, by channel */
    float observed[3], rendered[3];  /* weighted, over the expected radiance; rendered with solve's base colour */
    float squared[CORRECTION_KINDS]; /* squared residuals, weighted by the mean of the channels */
    float factor[3];                 /* logarithm of the factor in force */
};

struct correction {
    struct texture *base_color; /* borrowed, as the next two */
    const struct inverse_uv *inverse;
    const uint32_t *chart_of_triangle;
    uint32_t spacing;       /* texels a side of a block */
    uint32_t columns, rows; /* of blocks */
    uint32_t *first;        /* [columns * rows + 1] first cell of a block; owned, as all below */
    size_t count;
    uint32_t *chart;              /* [count] of each cell, by block */
    uint32_t (*neighbour)[4];     /* [count] cells of the chart left, right, above, below; MARKOV_NONE: none */
    struct markov_field field;    /* the cells' factors */
    struct correction_sums *sums; /* [count] */
    uint16_t (*solved)[3];        /* [height][width] base colour before correction */
    rgb *light;                   /* [count] mean observed radiance of a cell over its mean base colour */
};

/* Cells of `spacing` texels. */
void correction_init(struct correction *c, struct texture *base_color, const struct inverse_uv *inverse,
                     const uint32_t *chart_of_triangle, uint32_t spacing);
void correction_release(struct correction *c);
/* Takes the present base colour as that to be corrected, and clears the sums. */
void correction_start(struct correction *c);
/* Finds `light`. To be called before the first observation, and after sums and solved were loaded. */
void correction_set_light(struct correction *c, const struct fused *fused);

/* Expected radiance of a valid texel, from the mean of its cell: the observed radiance of a single texel shares noise
 * with its observations, which would bias their ratio. */
rgb correction_expected(const struct correction *c, uint32_t texel);

/* Adds one observation of a valid texel, rendered with the present base colour; `weight` in [0, 1]. */
void correction_add(struct correction *c, uint32_t texel, const struct comparison *comparison, float weight);

/* Finds the factors from all observations and applies them to base colour. */
void correction_apply(struct correction *c, struct parallel *pool);

#endif
