/* match.h -- how refine moves base colour: by the ratio of what was shown to what was rendered.
 *
 * Stochastic approximation (Robbins & Monro 1951) of the fixed point rendered = shown. To first order
 * a surface's radiance is its base colour times its light, so the ratio is the Newton step; its noise
 * is that of one estimate, where the gradient's is that of a product of two. What moves is a window
 * of the texture centred on the look: neighbouring looks overlap, so nothing shows where a block
 * ends. */
#ifndef UNBAKE_RECONSTRUCT_MATCH_H
#define UNBAKE_RECONSTRUCT_MATCH_H

#include <stddef.h>
#include <stdint.h>

#include "common/vec.h"
#include "server/reconstruct/emission.h"
#include "server/scene/inverse_uv.h"
#include "server/scene/materials.h"
#include "server/scene/photograph.h"
#include "server/scene/segment.h"

/* What one look tells, relative to what its texel is expected to show, by channel. (Relative to what
 * this photograph shows, its noise would be on both sides, and their mean ratio off by its variance.) */
struct match {
    float shown[3];    /* by the photograph, over (expected + a share of the median) */
    float rendered[3]; /* over the same */
    float trust;       /* half where the photograph is off by all that is expected, or by more where its noise is that
                        * far: a highlight, or light of what is in front */
};

/* From reference[sample_count] and radiance[sample_count] of one look. A saturated channel that the
 * render exceeds too counts as equal. `deviation` is that of the photograph's noise there, in radiance;
 * `median_radiance` is the photographs'. */
struct match match_look(const struct photograph_sample *reference, const rgb *radiance,
                        int sample_count, rgb expected, float deviation, float median_radiance);

struct matcher {
    struct texture *base_color;        /* borrowed, as all but block */
    const struct inverse_uv *inverse;
    const struct segments *segments;
    const uint32_t *chart_of_triangle;
    const struct emission *emission;   /* tells emitters, which move slowly */
    int level;                         /* a window is 2^level texels a side */
    struct matcher_block {
        float look_count; /* so far */
        float moved[3];   /* logarithm of the factor by which these looks scaled, by channel */
    } *block;             /* [blocks of that level]; owned */
};

void matcher_init(struct matcher *m, struct texture *base_color, const struct inverse_uv *inverse,
                  const struct segments *segments, const uint32_t *chart_of_triangle,
                  const struct emission *emission, int level);
void matcher_release(struct matcher *m);
size_t matcher_bytes(const struct matcher *m); /* of block[] */

/* One look at a valid texel: scales, by channel, all of its chart within half a window of it. The
 * step is 1 / (looks at its block so far + a prior, which is what the solved start is worth). The
 * prior keeps interreflection (all windows that scale together change the light as well) from
 * overshooting. Looks at a block together move by a tenth at most: what asks for more is not what solve left, but
 * light that renders lack or have too much of. `trust` in [0, 1] scales the step. */
void matcher_step(struct matcher *m, uint32_t texel, const struct match *match, float trust);

#endif
