/* pace.h -- the plan (plan.h) of a reconstruction: amounts of work, progress, and a text of what was left out.
 *
 * Amounts follow from settings (common/settings.c, by quality) and from the room; only a time limit reduces them. */
#ifndef UNBAKE_STATE_PACE_H
#define UNBAKE_STATE_PACE_H

#include <stdbool.h>

#include "server/capture/views.h"
#include "server/state/reconstruction.h"

/* Least part of the gathered directions that a time limit leaves. */
#define PACE_LEAST_GATHER 0.25

/* Plans before the first stage, by the expected number of texels. */
void pace_start(struct reconstruction *r, const struct reconstruct_hooks *hooks);
/* What pace_start forecasts, without a job: seconds, with no time limit. */
double pace_forecast_sec(const struct scene *scene, const struct settings *settings, struct parallel *pool);
/* Reports the beginning of a stage and the time left. */
void pace_begin_stage(struct reconstruction *r, const struct reconstruct_hooks *hooks, const char *stage);
/* Plans again when the surface is mapped and its number of texels is known. */
void pace_measure_room(struct reconstruction *r);
/* Plans solve for `valid` texels: directions of all probes in all passes; texels measured, in the passes before the
 * last and in the last; texels times steps of detail. */
void pace_plan_solve(struct reconstruction *r, double valid, double directions, double early_texels, double last_texels,
                     double detail_steps);

/* Plans the observations of refine or listing1. */
void pace_plan_observations(struct reconstruction *r, double observations);

/* Adds `work` to what is done of a part, reports the stage's progress and the time left, and plans again where there is
 * a limit. */
void pace_advance(struct reconstruction *r, const struct reconstruct_hooks *hooks, const char *stage,
                  enum plan_part part, double work);

/* Observations of refine or listing1 that the setting asks for: its value times the number of windows of a 64th of the
 * texture's side that the surface fills; infinite where only the time limit ends them. */
double pace_observations_wanted(const struct reconstruction *r);

/* Adds "work" to the report, and "time_limit" where there is one. If that left something out, r->left_out says so in a
 * sentence, which is logged as a warning. */
void pace_report(struct reconstruction *r, const struct reconstruct_hooks *hooks);

#endif
