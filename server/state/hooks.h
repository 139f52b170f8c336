/* hooks.h -- callbacks of a reconstruction to its caller. */
#ifndef UNBAKE_STATE_HOOKS_H
#define UNBAKE_STATE_HOOKS_H

#include <stdbool.h>
#include <stddef.h>

#include "common/error.h"
#include "server/state/state_array.h"

struct reconstruction; /* the present state, for previews and outputs */

/* Callbacks to the caller, made on the thread that runs reconstruct_run. */
struct reconstruct_hooks {
    void *user;
    bool (*stop_requested)(void *user);
    void (*stage)(void *user, const char *stage);
    void (*progress)(void *user, const char *stage, double done, double total, double eta_sec);
    void (*metric)(void *user, const char *series, long step, double value);
    void (*log)(void *user, const char *message);
    void (*warning)(void *user, const char *message);
    /* Working seconds of this attempt, without time of other processes, stops and sleep of the machine. Used for
     * forecasts and the time limit only. */
    double (*worked_sec)(void *user);
    /* True when a checkpoint / preview is due (the caller keeps the clock). */
    bool (*checkpoint_due)(void *user);
    bool (*preview_due)(void *user);
    /* Commits all arrays as the newest checkpoint, or fails and keeps the previous one. */
    enum status (*checkpoint_save)(void *user, long iteration, const struct state_array *array, size_t count,
                                   struct error *err);
    /* Fills the arrays from the newest complete checkpoint; *found is false and the arrays are untouched when there is
     * none. STATUS_CORRUPT if a stored size differs. */
    enum status (*checkpoint_load)(void *user, struct state_array *array, size_t count, bool *found, struct error *err);
    enum status (*preview)(void *user, const struct reconstruction *r, struct error *err);
};

#endif
