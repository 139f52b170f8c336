/* optimiser.h -- iterating on a reconstruction until its iterations or its observations are done: what the two
 * methods that follow paths, listing1.h and refine.h, have in common. Time ends it only where the plan has a limit
 * (plan.h).
 *
 * An iteration is a pass over the surface (pass.h) and a step by what it found; both are the
 * method's. Around them here: progress, the loss curve, checkpoints, previews, figures.
 * A checkpoint holds the materials, the evidence and decision about emitters, what is told with
 * optimiser_keep, and the counters; the method says what it needs beyond that. */
#ifndef UNBAKE_REFINE_OPTIMISER_H
#define UNBAKE_REFINE_OPTIMISER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "server/refine/emission.h"
#include "server/refine/pass.h"
#include "server/state/reconstruction.h"

#define OPTIMISER_CURVE_POINTS 256
#define OPTIMISER_ARRAYS 24

/* Step sizes fall from this part of the run on; listing1 decides about emitters there. */
#define OPTIMISER_FALL_FROM 0.08

/* How a method iterates; `self` is its own. */
struct optimiser_method {
    /* Runs a pass of o->pass and moves the materials. `fraction` of the run is done, in [0, 1). */
    void (*iterate)(void *self, double fraction);
    /* The arrays that are kept were just filled from a checkpoint. */
    void (*resumed)(void *self);
    /* After the last iteration, before it is saved; NULL: nothing is left to do. */
    void (*finish)(void *self);
    void (*free)(void *self);
};

/* What a checkpoint holds of the run itself. */
struct optimiser_counters {
    uint64_t iteration, path_count;
    double elapsed_sec; /* working time of all attempts */
    double iterate_sec; /* that iterations took */
    double planned;     /* iterations or observations that the curve is drawn over */
    double curve_sum[OPTIMISER_CURVE_POINTS], curve_count[OPTIMISER_CURVE_POINTS]; /* of mean losses */
};

/* What a checkpoint holds of the plan: of each part what was wanted and what is done. */
struct optimiser_plan {
    double wanted[PLAN_PARTS], done[PLAN_PARTS];
    double ended_at_sec; /* the time limit that was in force when the run was over; 0: it is not */
};

struct optimiser {
    struct reconstruction *r;              /* borrowed, all three */
    const struct views *views;
    const struct reconstruct_hooks *hooks;
    const struct optimiser_method *method;
    void *self;                            /* the method's; owned, given to method->free */
    struct pass pass;
    struct emission emission;
    struct optimiser_counters counters;
    struct optimiser_plan plan;
    uint64_t surface;                      /* names what textures are laid over */
    uint64_t iteration_limit;              /* 0: by observations */
    size_t state_count;
    struct state_array state[OPTIMISER_ARRAYS]; /* what a checkpoint holds */
};

/* Starts from r->materials. `derivatives` says that paths will be walked backwards. Borrows all but
 * `self`, which it takes. */
struct optimiser *optimiser_new(struct reconstruction *r, const struct views *views,
                                const struct reconstruct_hooks *hooks, bool derivatives,
                                const struct optimiser_method *method, void *self);
void optimiser_free(struct optimiser *o);

/* Checkpoints hold data[bytes], too, from now on. It stays where it is; the name is not copied. */
void optimiser_keep(struct optimiser *o, const char *name, void *data, size_t bytes);

/* Checkpoints of formats before `format` (state.h) do not have it: it keeps what it holds. */
void optimiser_keep_since(struct optimiser *o, int format, const char *name, void *data, size_t bytes);

/* Takes up the newest checkpoint where there is one that fits; saves one. */
enum status optimiser_load(struct optimiser *o, bool *found, struct error *err);
enum status optimiser_save(struct optimiser *o, struct error *err);

/* Iterates to the end, with a checkpoint there. Adds "refine" and the loss curve to r->report.
 * STATUS_CANCELLED when stopped (a checkpoint was saved). */
enum status optimiser_run(struct optimiser *o, struct error *err);

/* The factor of step sizes when `fraction` of the run is done: 1 at first, then falling. */
float optimiser_rate_fall(double fraction);

#endif
