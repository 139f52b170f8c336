/* emission.h -- the radiance of the emitters as unknowns, and how an optimiser step moves them.
 *
 * It moves in the logarithm, since lamps outshine walls by factors of thousands, by Adam, a segment
 * at a time. What is black stays black. */
#ifndef UNBAKE_REFINE_EMISSION_H
#define UNBAKE_REFINE_EMISSION_H

#include <stdbool.h>
#include <stddef.h>

#include "common/vec.h"
#include "server/refine/adam.h"
#include "server/scene/materials.h"

struct emission {
    struct materials *materials; /* borrowed; its emission[] is what is moved */
    const bool *is_emitter;      /* [segment_count] borrowed; NULL until the emitters are known */
    struct adam adam;            /* an entry a segment; owned, as all below */
    float (*log_radiance)[3];    /* [segment_count] what is optimised: materials hold its exponential */
};

/* Starts from the materials as they are. */
void emission_init(struct emission *e, struct materials *materials);
void emission_release(struct emission *e);

/* Sets a segment's radiance, with moments that start anew. */
void emission_set(struct emission *e, size_t segment, rgb radiance);

/* Tells the emitters from now on (borrowed): all other segments emit exactly 0, for good. */
void emission_fix(struct emission *e, const bool *is_emitter);

/* One step of about `rate`, in logarithms, against the derivatives of the loss by radiance. */
void emission_step(struct emission *e, const double (*d_radiance)[3], float rate);

/* The share of its step by which a segment's base colour moves: an emitter's own light hides it. */
float emission_slowdown(const struct emission *e, size_t segment);

#endif
