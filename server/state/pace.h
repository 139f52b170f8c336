/* pace.h -- the plan (plan.h) of a reconstruction: amounts of work, progress, and a text of what was left out.
 *
 * Amounts follow from settings (common/settings.c, by quality) and from the room; only a time limit reduces them. */
#ifndef UNBAKE_STATE_PACE_H
#define UNBAKE_STATE_PACE_H

#include "common/json.h"
#include "common/parallel.h"
#include "common/settings.h"
#include "server/scene/inverse_uv.h"
#include "server/scene/scene.h"
#include "server/state/hooks.h"
#include "server/state/plan.h"

/* Least part of the gathered directions that a time limit leaves. */
#define PACE_MIN_GATHER 0.25

/* What the amounts follow from, and the plan, which the functions below write. All borrowed. */
struct pace {
    struct plan *plan;
    const struct settings *settings;
    const struct reconstruct_hooks *hooks; /* for the clock and for who is told */
    int thread_count;
};

/* Plans before the first stage, by the expected number of texels. */
void pace_start(const struct pace *p, const struct scene *scene);
/* What pace_start forecasts, without a job: seconds, with no time limit. */
double pace_forecast_sec(const struct scene *scene, const struct settings *settings, struct parallel *pool);
/* Reports the beginning of a stage and the time left. */
void pace_begin_stage(const struct pace *p, const char *stage);
/* Plans again when the surface is mapped and its number of texels is known. */
void pace_measure_room(const struct pace *p, const struct scene *scene, const struct inverse_uv *inverse);
/* Plans solve for `valid` texels: directions of all probes in all passes; texels measured, in the passes before the
 * last and in the last; texels times steps of detail. */
void pace_plan_solve(const struct pace *p, double valid, double directions, double early_texels, double last_texels,
                     double detail_steps);

/* Plans the observations of refine or listing1. */
void pace_plan_observations(const struct pace *p, double observations);

/* Adds `work` to what is done of a part, reports the stage's progress and the time left, and plans again where there is
 * a limit. */
void pace_advance(const struct pace *p, const char *stage, enum plan_part part, double work);

/* Observations of refine or listing1 that the setting asks for: its value times the number of windows of a 64th of the
 * texture's side that the surface fills; infinite where only the time limit ends them. */
double pace_observations_wanted(const struct pace *p, const struct inverse_uv *inverse);

/* Adds "work" to the report, and "time_limit" where there is one. If that left something out, left_out[size] says so in
 * a sentence, which is logged as a warning; "" else. */
void pace_report(const struct pace *p, cJSON *report, char *left_out, size_t size);

#endif
