/* params.h -- the unknowns of listing1, and their Adam steps.
 *
 * Base colour in [0, 1], by texel or, at the coarse levels, by a common factor of a block of texels (blocks.h);
 * roughness in [PARAMS_ROUGHNESS_MIN, 1] and specular in [0, 1], by segment; emission as in emission.h. Materials and
 * moments are in checkpoints. */
#ifndef UNBAKE_REFINE_PARAMS_H
#define UNBAKE_REFINE_PARAMS_H

#include <stdbool.h>
#include <stdint.h>

#include "common/parallel.h"
#include "server/refine/adam.h"
#include "server/refine/emission.h"
#include "server/render/gradient.h"
#include "server/scene/inverse_uv.h"
#include "server/scene/materials.h"
#include "server/scene/segment.h"

#define PARAMS_ROUGHNESS_MIN 0.05f /* the smoothest candidate of the specular fit, too; +25 %: no change */

/* Step sizes of one iteration. */
struct params_rates {
    float base_color;
    float roughness;
    float specular;
    float emission; /* in logarithms */
};

struct params {
    struct materials *materials;      /* borrowed; written */
    const struct inverse_uv *inverse; /* borrowed */
    const struct segments *segments;  /* borrowed */
    struct emission *emission;        /* borrowed */
    bool frees_segments;              /* roughness, specular and emission are stepped, too */
    struct adam base_color;           /* an entry a texel, or a block at coarse levels; owned */
    struct adam roughness, specular;  /* an entry a segment; owned */
    int level;                        /* blocks of 2^level texels a side share a factor */
    /* Scratch of the coarse levels; NULL at level 0; owned. */
    float (*block_sum)[3]; /* [blocks at level 1] zero between steps */
    uint32_t *block_stamp; /* [blocks at level 1] the step that last listed the block */
    uint32_t stamp;
    uint32_t *block; /* [block_capacity] blocks touched in this step */
    size_t block_capacity;
};

/* Starts from the present materials; a segment of emission 0 never emits. `emission` is of the same materials. */
void params_init(struct params *p, struct materials *materials, const struct inverse_uv *inverse,
                 const struct segments *segments, struct emission *emission, int level);
void params_release(struct params *p);

/* Goes to a finer level and resets the moments of base colour. */
void params_refine(struct params *p, int level);
/* Sets the level of moments that were restored from a checkpoint. */
void params_set_level(struct params *p, int level);

/* Steps roughness, specular and emission from now on: until the emitters are known they are ambiguous with emission. */
void params_free_segments(struct params *p);

/* One descent step. Base colour of an emitter has smaller steps (emission_slowdown). */
void params_step(struct params *p, const struct gradient *gradient, const struct params_rates *rates,
                 struct parallel *pool);

#endif
