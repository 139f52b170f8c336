/* optimiser.h -- the loop that the two path-traced methods, listing1.h and refine.h, share: iterations until their
 * number or that of the observations is reached. Time ends it only where the plan has a limit (plan.h).
 *
 * An iteration is a pass over the surface (pass.h) and a step by its result; both are the method's. The loop adds
 * progress, the loss curve, checkpoints, previews and figures. A checkpoint holds the materials, the evidence and
 * decision about emitters, the counters, and the arrays that the method names with optimiser_add_state. */
#ifndef UNBAKE_REFINE_OPTIMISER_H
#define UNBAKE_REFINE_OPTIMISER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "server/refine/emission.h"
#include "server/refine/pass.h"
#include "server/state/estimated_light.h"
#include "server/state/evidence.h"
#include "server/state/pace.h"

#define OPTIMISER_CURVE_POINTS 256 /* of the loss curve; part of the checkpoint format */
#define OPTIMISER_ARRAYS 24        /* arrays of a checkpoint, at most */

/* Part of the run after which step sizes fall; listing1 decides about emitters there: of 1,000 iterations 80,
 * eight time constants of the first moment (emission.c). */
#define OPTIMISER_FALL_FROM 0.08 /* +25 %: -0.18 dB, roughness -0.08, specular -0.14 */

/* A method; `self` is its object. */
struct optimiser_method {
    /* Runs a pass of o->pass and moves the materials. `fraction` of the run is done, in [0, 1). */
    void (*iterate)(void *self, double fraction);
    /* Called after the kept arrays were filled from a checkpoint. */
    void (*resumed)(void *self);
    /* Called after the last iteration, before the checkpoint; may be NULL. */
    void (*finish)(void *self);
    void (*free)(void *self);
};

/* What a run reads and writes. Borrowed, and valid until it is freed. */
struct optimiser_input {
    struct surface surface;
    const struct views *views;
    const struct pace *pace; /* its plan is written */
    struct parallel *pool;
    /* Written, and kept in checkpoints. */
    struct materials *materials;
    bool *is_emitter;                  /* [segment_count] */
    struct emitter_evidence *evidence; /* [segment_count] */
    rgb *sky_factor, *sun_irradiance;  /* by solve; not changed here */
    struct estimated_light *light;     /* the same */
    /* Written. */
    struct world *world;                    /* its lights follow the materials */
    cJSON *report;                          /* object */
    const struct reconstruction *previewed; /* given to hooks->preview, not read */
};

/* The run's counters; in checkpoints. */
struct optimiser_counters {
    uint64_t iteration, path_count;
    double elapsed_sec; /* working time of all attempts */
    double iterate_sec; /* time of iterations */
    double planned;     /* iterations or observations along the curve's axis */
    double curve_sum[OPTIMISER_CURVE_POINTS], curve_count[OPTIMISER_CURVE_POINTS]; /* of mean losses */
};

/* The plan's state; in checkpoints. */
struct optimiser_plan {
    double wanted[PLAN_PARTS], done[PLAN_PARTS];
    double ended_at_sec; /* time limit in force when the run ended; 0: it has not ended */
};

struct optimiser {
    struct optimiser_input in;
    const struct settings *settings; /* borrowed, all three */
    const struct reconstruct_hooks *hooks;
    const struct optimiser_method *method;
    void *self; /* the method's; owned, given to method->free */
    struct pass pass;
    struct emission emission;
    struct optimiser_counters counters;
    struct optimiser_plan plan;
    uint64_t surface;         /* hash of the surface parametrisation (STATE_SURFACE) */
    uint64_t iteration_limit; /* 0: the number of observations ends the run */
    size_t state_count;
    struct state_array state[OPTIMISER_ARRAYS]; /* arrays of a checkpoint */
};

/* Starts from the materials as they are. `derivatives`: paths are kept for a backward pass. Takes `self`. */
struct optimiser *optimiser_new(const struct optimiser_input *input, bool derivatives,
                                const struct optimiser_method *method, void *self);
void optimiser_free(struct optimiser *o);

/* Adds data[bytes] to the checkpoints. Borrows both name and data. */
void optimiser_add_state(struct optimiser *o, const char *name, void *data, size_t bytes);

/* Loads the newest checkpoint that fits, if any; saves one. */
enum status optimiser_load(struct optimiser *o, bool *found, struct error *err);
enum status optimiser_save(struct optimiser *o, struct error *err);

/* Iterates to the end and saves a checkpoint. Adds "refine" and the loss curve to the report. STATUS_CANCELLED when
 * stopped, after a checkpoint. */
enum status optimiser_run(struct optimiser *o, struct error *err);

/* Factor of step sizes when `fraction` of the run is done: 1 at first, then falling. */
float optimiser_rate_fall(double fraction);

#endif
