/* pace.h -- the plan (plan.h) of a reconstruction: its amounts by settings and room, its progress, what of it was left
 * out, in words.
 *
 * Amounts come from settings (common/settings.c, by quality) and from the room; only a time limit makes them less. */
#ifndef UNBAKE_STATE_PACE_H
#define UNBAKE_STATE_PACE_H

#include <stdbool.h>

#include "server/capture/views.h"
#include "server/state/reconstruction.h"

/* Of the directions of gathered light a time limit leaves at least so much. */
#define PACE_LEAST_GATHER 0.25

/* Before the first stage: what is to be expected of the room, whose surface is not yet mapped. */
void pace_start(struct reconstruction *r, const struct reconstruct_hooks *hooks);
/* Tells that a stage begins, and the time left. */
void pace_begin_stage(struct reconstruction *r, const struct reconstruct_hooks *hooks, const char *stage);
/* As soon as the surface is mapped and photographs are known: of its true size. */
void pace_measure_room(struct reconstruction *r);
/* What solve does on a surface of so many valid texels: directions that all probes gather, in all passes; texels that are
 * measured, in the passes before the last and in that; texels times steps of detail. */
void pace_plan_solve(struct reconstruction *r, double valid, double directions, double early_texels, double last_texels,
                     double detail_steps);

/* So many observations of refine or listing1. */
void pace_plan_observations(struct reconstruction *r, double looks);

/* So much more of a part is done: tells the progress of the stage, its parts being first to last, and the time left, and
 * plans anew where there is a limit. */
void pace_advance(struct reconstruction *r, const struct reconstruct_hooks *hooks, const char *stage,
                  enum plan_part part, double work);

/* Observations of refine or listing1 that are wanted for each part of the texture, times their number; infinite where
 * only the time limit ends them. */
double pace_observations_wanted(const struct reconstruction *r);

/* Adds "work" to the report, and "time_limit" where there is one. Where that left something out, r->left_out says so in
 * a sentence, which is logged as a warning. */
void pace_report(struct reconstruction *r, const struct reconstruct_hooks *hooks);

#endif
