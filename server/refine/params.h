/* params.h -- the unknowns of listing1 and how a step of Adam moves them.
 *
 * Base colour moves in [0, 1], texel by texel or, at the coarse levels, a block of texels by a
 * common factor (blocks.h); roughness and specular in [PARAMS_ROUGHNESS_MIN, 1] and [0, 1], a number
 * each a segment; emission as emission.h has it. The materials and all moments are the state that
 * a checkpoint holds. */
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

#define PARAMS_ROUGHNESS_MIN 0.05f

/* Step sizes of one iteration. */
struct params_rates {
    float base_color;
    float roughness;
    float specular;
    float emission; /* in logarithms */
};

struct params {
    struct materials *materials;      /* borrowed; what is moved */
    const struct inverse_uv *inverse; /* borrowed */
    const struct segments *segments;  /* borrowed */
    struct emission *emission;        /* borrowed */
    bool frees_segments;              /* roughness, specular and emission move, too */
    struct adam base_color;           /* an entry a texel, or a block at coarse levels; owned */
    struct adam roughness, specular;  /* an entry a segment; owned */
    int level;                        /* blocks of 2^level texels a side move by a common factor */
    /* Scratch of the coarse levels; NULL at level 0; owned. */
    float (*block_sum)[3];            /* [blocks at level 1] zero between steps */
    uint32_t *block_stamp;            /* [blocks at level 1] the step that last listed the block */
    uint32_t stamp;
    uint32_t *block;                  /* [block_capacity] blocks touched in this step */
    size_t block_capacity;
};

/* Starts from the materials as they are; a segment whose emission is 0 never emits. `emission` is of
 * the same materials. */
void params_init(struct params *p, struct materials *materials, const struct inverse_uv *inverse,
                 const struct segments *segments, struct emission *emission, int level);
void params_release(struct params *p);

/* Goes to a finer level: the moments of base colour start anew. */
void params_refine(struct params *p, int level);
/* Says at which level the moments are that were restored from a checkpoint. */
void params_set_level(struct params *p, int level);

/* Lets roughness, specular and emission move from now on: until the emitters are known nothing that a
 * segment shows can be told from its own light. */
void params_free_segments(struct params *p);

/* One step against the gradient. Base colour of an emitter moves slowly (emission_slowdown). */
void params_step(struct params *p, const struct gradient *gradient, const struct params_rates *rates,
                 struct parallel *pool);

#endif
