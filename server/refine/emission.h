/* emission.h -- radiance of the emitters as unknowns of the optimiser.
 *
 * Optimised in the logarithm, since lamps outshine walls by factors of thousands, by Adam with one entry a segment. A
 * radiance of 0 stays 0. */
#ifndef UNBAKE_REFINE_EMISSION_H
#define UNBAKE_REFINE_EMISSION_H

#include <stdbool.h>
#include <stddef.h>

#include "common/vec.h"
#include "server/refine/adam.h"
#include "server/scene/materials.h"

struct emission {
    struct materials *materials; /* borrowed; its emission[] is written */
    const bool *is_emitter;      /* [segment_count] borrowed; NULL until the emitters are known */
    struct adam adam;            /* an entry a segment; owned, as all below */
    float (*log_radiance)[3];    /* [segment_count] the unknowns; materials hold their exponentials */
};

/* Starts from the materials as they are. */
void emission_init(struct emission *e, struct materials *materials);
void emission_release(struct emission *e);

/* Sets a segment's radiance and resets its moments. */
void emission_set(struct emission *e, size_t segment, rgb radiance);

/* Sets which segments emit (borrowed): all others emit exactly 0 from now on. */
void emission_fix(struct emission *e, const bool *is_emitter);

/* One step of about `rate`, in logarithms, against the derivatives of the loss by radiance. */
void emission_step(struct emission *e, const double (*d_radiance)[3], float rate);

/* Factor of the steps of a segment's base colour: small for an emitter, whose own light hides its reflection. */
float emission_slowdown(const struct emission *e, size_t segment);

#endif
