/* params.h -- the unknowns of a reconstruction and how an optimiser step moves them.
 *
 * Base colour moves in [0, 1], texel by texel or, at the coarse levels, a block of texels by a
 * common factor; roughness and specular in [ROUGHNESS_MIN, 1] and [0, 1]; emission
 * in the logarithm of radiance, since lamps outshine walls by factors of thousands. All of it,
 * with the moments, is the state that a checkpoint holds. */
#ifndef UNBAKE_RECONSTRUCT_PARAMS_H
#define UNBAKE_RECONSTRUCT_PARAMS_H

#include <stdbool.h>
#include <stdint.h>

#include "common/parallel.h"
#include "server/reconstruct/adam.h"
#include "server/reconstruct/loss.h"
#include "server/render/gradient.h"
#include "server/scene/inverse_uv.h"
#include "server/scene/materials.h"
#include "server/scene/segment.h"

#define PARAMS_ROUGHNESS_MIN 0.05f

/* Step sizes of one iteration. */
struct params_rates {
    float base_color;
    float roughness;
    float specular;
    float emission;       /* in logarithms */
    bool skip_base_color; /* it moves by params_match instead */
};

struct params {
    struct materials *materials; /* borrowed; what is moved */
    const struct inverse_uv *inverse;    /* borrowed */
    const struct segments *segments;     /* borrowed */
    const uint32_t *chart_of_triangle; /* borrowed */
    const bool *is_emitter;      /* [segment_count] borrowed; NULL until the emitters are known */
    bool any_emits;              /* no emitters are told; all segments move */
    struct adam base_color;      /* an entry a texel, or a block at coarse levels */
    struct adam roughness, specular, emission; /* an entry a segment */
    float (*log_emission)[3];    /* [segment_count]; owned */
    int level;                   /* blocks of 2^level texels a side move by a common factor */
    /* Scratch of the coarse levels; NULL at level 0; owned. */
    float (*block_sum)[3];       /* [blocks at level 1] zero between steps */
    uint32_t *block_stamp;       /* [blocks at level 1] the step that last listed the block */
    uint32_t stamp;
    uint32_t *block;             /* [block_capacity] blocks touched in this step */
    size_t block_capacity;
};

/* Starts from the materials as they are; a segment whose emission is 0 never emits. */
void params_init(struct params *p, struct materials *materials, const struct inverse_uv *inverse,
                 const struct segments *segments, const uint32_t *chart_of_triangle, int level);
void params_release(struct params *p);

/* Goes to a finer level: the moments of base colour start anew. */
void params_refine(struct params *p, int level);
/* Says at which level the moments are that were restored from a checkpoint. */
void params_set_level(struct params *p, int level);

/* One step against the gradient; segments' parameters keep still until the emitters are known. */
void params_step(struct params *p, const struct gradient *gradient, const struct params_rates *rates,
                 struct parallel *pool);

/* The step of base colour from a solved start, after one look at a texel: scales all of its chart within
 * half a block of it, by channel, by the ratio of what was shown to what was rendered. Neighbouring
 * looks overlap, so nothing shows where a block ends.
 *
 * Stochastic approximation (Robbins & Monro 1951) of the fixed point rendered = shown with a step of
 * 1 / (looks + prior), of the block's past looks, the prior being what the solved start is worth. To first
 * order a surface's radiance is its base colour times its light, so the ratio is the Newton step; its
 * noise is that of one estimate, where the gradient's is that of a product of two. The prior keeps interreflection (all blocks that scale
 * together change the light as well) from overshooting, and grows from level to level: a finer
 * block starts from what its parent knew. */
void params_match(struct params *p, uint32_t texel, const struct loss_match *match, float trust);

/* Tells the emitters from now on (borrowed): all other segments emit exactly 0, for good, and the
 * reflectance of an emitter, which its own light hides, moves slowly. */
void params_fix_emitters(struct params *p, const bool *is_emitter);

/* Tells that there is no telling: from now on any segment may emit. */
void params_free_emission(struct params *p);

/* Sets a segment's emission, with moments that start anew. */
void params_set_emission(struct params *p, size_t segment, rgb emission);

#endif
