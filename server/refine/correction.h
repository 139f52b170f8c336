/* correction.h -- the smooth factor by which refine moves base colour, and how sure it is of it.
 *
 * What solve leaves are errors of the light, which change slowly along a surface: of a chart's part in each block of
 * the atlas, a cell, what photographs showed and what was rendered is summed, and their ratio is the factor by which
 * its base colour is off (to first order a surface's radiance is its base colour times its light). One look is off by
 * a third, so factors are those that are most likely by all looks and two priors: solve's light is about right, and a
 * factor is about that of the cells beside it in its chart (a Gaussian Markov random field: Rue and Held 2005). What
 * makes colours other than they are is thought less likely than what makes them lighter or darker. Between the middles
 * of cells factors are interpolated; texture within stays.
 *
 * Photographs' noise is taken as the looks themselves tell of it; but a channel counts for less, in lightness too, the
 * more of it is noise: that is told of all photographs (noise.h). No factor moves base colour by more than a tenth:
 * what asks for more is not what solve left, but light that the renders lack or have too much of. */
#ifndef UNBAKE_REFINE_CORRECTION_H
#define UNBAKE_REFINE_CORRECTION_H

#include <stddef.h>
#include <stdint.h>

#include "common/parallel.h"
#include "server/capture/fuse.h"
#include "server/refine/match.h"
#include "server/scene/inverse_uv.h"
#include "server/scene/texture.h"

/* Of lightness, common to all channels, and of what the channels differ in. */
enum { CORRECTION_GRAY, CORRECTION_TINT, CORRECTION_KINDS };

struct correction_cell {
    uint32_t chart;
    uint32_t beside[4];              /* cells of the chart in the blocks around; UINT32_MAX: none */
};

/* What looks told of a cell. */
struct correction_sums {
    float weight[3];                 /* of looks, each of 1 at most, by channel */
    float shown[3], rendered[3];     /* weighted, relative to what was expected; rendered with base colour as solved */
    float squared[CORRECTION_KINDS]; /* squares of what looks are off by, weighted by the mean of the channels */
    float factor[3];                 /* logarithm, now in force */
};

struct correction {
    struct texture *base_color;      /* borrowed, as the next two */
    const struct inverse_uv *inverse;
    const uint32_t *chart_of_triangle;
    uint32_t spacing;                /* texels a side of a block */
    uint32_t columns, rows;          /* of blocks */
    uint32_t *first;                 /* [columns * rows + 1] first cell of a block; owned, as all below */
    size_t count;
    struct correction_cell *cell;    /* [count] by block */
    struct correction_sums *sums;    /* [count] */
    uint16_t (*solved)[3];           /* [height][width] base colour before it was moved */
    rgb *light;                      /* [count] what is shown of a cell over its base colour, in the mean */
};

/* Cells of `spacing` texels. */
void correction_init(struct correction *c, struct texture *base_color, const struct inverse_uv *inverse,
                     const uint32_t *chart_of_triangle, uint32_t spacing);
void correction_release(struct correction *c);
/* The base colour that is now is the one to be moved; nothing was looked at. */
void correction_start(struct correction *c);
/* Before the first look, and after sums and solved were filled from elsewhere. */
void correction_set_light(struct correction *c, const struct fused *fused);

/* What a valid texel is expected to show. It has little of the noise of the photographs: that of a single texel would
 * be in what is shown of it, too, and relative to it the mean of what is shown too small. */
rgb correction_expected(const struct correction *c, uint32_t texel);

/* Adds one look at a valid texel that was rendered with base colour as it is now; `weight` in [0, 1]. */
void correction_look(struct correction *c, uint32_t texel, const struct match *match, float weight);

/* Moves base colour to the factors that are most likely by all looks. */
void correction_apply(struct correction *c, struct parallel *pool);

#endif
