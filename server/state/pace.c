/* pace.c -- see pace.h.
 *
 * Priors are processor seconds of one core, measured on staircase2 at 2048 and on the demo room at 512 texels a side
 * (which differ by up to a factor of 2), on a loaded virtual machine of two cores. They only serve the first forecasts;
 * measurements of the run replace them (plan.h). */
#include "server/state/pace.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/parallel.h"

#define PREPARE_SEC 3.0          /* of any room */
#define PREPARE_PIXEL_SEC 4.5e-6 /* a pixel of photographs */
#define PREPARE_TEXEL_SEC 1.6e-6 /* a texel of the square, mapped or not */
#define FUSE_SEC 2.0             /* likewise */
#define FUSE_TEXEL_SEC 9.0e-6    /* a mapped texel, as all below */
#define GATHER_SEC 0.45e-6       /* a direction */
#define FIT_SPECULAR_SEC 13.0    /* a specular fit */
#define FIT_TEXEL_SEC 3.5e-6     /* a texel, for the fits of lamps and emitters */
#define MEASURE_SEC 16.0e-6      /* a texel measured */
#define DETAIL_SEC 0.9e-6        /* a step */
#define REFINE_PATH_SEC 1.7e-6   /* a path of refine */
#define LISTING1_FACTOR 1.5      /* on that, of listing1, which walks paths backwards as well */
#define REPORT_SEC 1.2e-6        /* a path of a held-out re-render */
#define EXPORT_TEXEL_SEC 3.0e-6  /* a texel of the square */
/* Usual part of the square that charts cover, and probes per block of mapped texels. */
#define USUAL_COVER 0.75
#define USUAL_PROBES 1.3

#define WINDOWS_ACROSS 64 /* windows along the texture's side by which observations are counted; part of the settings */
/* Parts that a time limit leaves of each before it cuts the next (plan.h). By hand. */
#define MODEST_OBSERVATIONS 0.1
#define MODEST_REPORT 0.125
#define MIN_MEASURE 0.25 /* one texel in 2 x 2 */

static double threads(const struct reconstruction *r) { return (double)parallel_thread_count(r->pool); }

static double side(const struct reconstruction *r) { return settings_number(r->settings, "texture_size"); }

static bool solves(const struct reconstruction *r) { return settings_is(r->settings, "method", "solve"); }

double pace_observations_wanted(const struct reconstruction *r) {
    const char *name = solves(r) ? "refine_looks" : "listing1_looks";
    double observations = settings_number(r->settings, name);
    if (observations == 0.0)
        observations = isinf(r->plan.limit_sec) ? settings_of_quality(r->settings, name) : (double)INFINITY;
    uint32_t larger = r->inverse.width > r->inverse.height ? r->inverse.width : r->inverse.height;
    double window = larger > WINDOWS_ACROSS ? (double)(larger / WINDOWS_ACROSS) : 1.0;
    return observations * ceil((double)r->inverse.valid_count / (window * window));
}

static void plan_refine(struct reconstruction *r, double wanted, double modest) {
    double sec = settings_number(r->settings, "samples_per_camera") * REFINE_PATH_SEC / threads(r);
    plan_set(&r->plan, PLAN_REFINE, wanted, MODEST_OBSERVATIONS * modest, 0.0, solves(r) ? sec : LISTING1_FACTOR * sec);
}

void pace_plan_observations(struct reconstruction *r, double observations) {
    plan_refine(r, observations, observations);
}

static void plan_report(struct reconstruction *r, double pixels) {
    double samples = settings_number(r->settings, "report_samples");
    plan_set(&r->plan, PLAN_REPORT, pixels * samples, pixels * fmax(ceil(MODEST_REPORT * samples), 1.0), pixels,
             REPORT_SEC / threads(r));
}

void pace_plan_solve(struct reconstruction *r, double valid, double directions, double early_texels, double last_texels,
                     double detail_steps) {
    double n = threads(r);
    plan_set(&r->plan, PLAN_GATHER, directions, directions, PACE_LEAST_GATHER * directions, GATHER_SEC / n);
    plan_set(&r->plan, PLAN_MEASURE, early_texels + last_texels, early_texels + last_texels,
             early_texels + MIN_MEASURE * last_texels, MEASURE_SEC / n);
    plan_set(&r->plan, PLAN_DETAIL, detail_steps, detail_steps, 0.0, DETAIL_SEC / n);
    plan_set_fixed(&r->plan, PLAN_FIT, 1.0,
                   (FIT_SPECULAR_SEC * settings_number(r->settings, "gloss_passes") + FIT_TEXEL_SEC * valid) / n);
    plan_fit(&r->plan);
}

/* Plans everything that depends on the number of mapped texels. */
static void plan_texels(struct reconstruction *r, double valid) {
    double n = threads(r), stride = settings_number(r->settings, "measure_stride");
    plan_set_fixed(&r->plan, PLAN_FUSE, 1.0, (FUSE_SEC + FUSE_TEXEL_SEC * valid) / n);
    plan_set_fixed(&r->plan, PLAN_EXPORT, 1.0, EXPORT_TEXEL_SEC * side(r) * side(r)); /* on one core, mostly */
    if (!solves(r))
        return;
    double spacing = fmax(side(r) * 8.0 / 2048.0, 4.0); /* as solve.c has it */
    double probes = USUAL_PROBES * valid / (spacing * spacing), texels = valid / (stride * stride);
    pace_plan_solve(r, valid, 1.5 * probes * settings_number(r->settings, "gather_samples"), 0.5 * texels, texels,
                    settings_number(r->settings, "detail_steps") * valid);
}

static void plan_all(struct reconstruction *r) {
    double pixels = 0.0, held_out = 0.0, every = settings_number(r->settings, "hold_out_every");
    plan_init(&r->plan, settings_number(r->settings, "time_limit_sec"));
    for (size_t i = 0; i < r->scene->photograph_count; i++) {
        const struct camera *c = &r->scene->photograph[i].camera;
        pixels += (double)c->width * (double)c->height;
        held_out += r->scene->photograph[i].is_test ? (double)c->width * (double)c->height : 0.0;
    }
    if (held_out == 0.0 && every > 0.0)
        held_out = pixels / every;
    double valid = USUAL_COVER * side(r) * side(r);
    plan_set_fixed(&r->plan, PLAN_PREPARE, 1.0,
                   (PREPARE_SEC + PREPARE_PIXEL_SEC * pixels + PREPARE_TEXEL_SEC * side(r) * side(r)) / threads(r));
    plan_texels(r, valid);
    double windows = USUAL_COVER * WINDOWS_ACROSS * WINDOWS_ACROSS;
    const char *name = solves(r) ? "refine_looks" : "listing1_looks";
    plan_refine(r, windows * settings_number(r->settings, name), windows * settings_of_quality(r->settings, name));
    plan_report(r, held_out);
}

void pace_start(struct reconstruction *r, const struct reconstruct_hooks *hooks) {
    plan_all(r);
    plan_pass_time(&r->plan, hooks->worked_sec(hooks->user)); /* reading the scene */
}

double pace_forecast_sec(const struct scene *scene, const struct settings *settings, struct parallel *pool) {
    struct reconstruction r = {.scene = (struct scene *)scene, .settings = settings, .pool = pool}; /* is only read */
    plan_all(&r);
    return plan_left_sec(&r.plan);
}

void pace_measure_room(struct reconstruction *r) {
    double held_out = 0.0, wanted = pace_observations_wanted(r);
    const char *name = solves(r) ? "refine_looks" : "listing1_looks";
    for (size_t i = 0; i < r->scene->photograph_count; i++) {
        const struct camera *c = &r->scene->photograph[i].camera;
        held_out += r->scene->photograph[i].is_test ? (double)c->width * (double)c->height : 0.0;
    }
    plan_texels(r, (double)r->inverse.valid_count);
    double usual = isinf(wanted) ? settings_of_quality(r->settings, name) * WINDOWS_ACROSS * WINDOWS_ACROSS : wanted;
    plan_refine(r, wanted, usual);
    plan_report(r, held_out);
}

void pace_begin_stage(struct reconstruction *r, const struct reconstruct_hooks *hooks, const char *stage) {
    plan_pass_time(&r->plan, hooks->worked_sec(hooks->user));
    hooks->progress(hooks->user, stage, 0.0, 1.0, plan_left_sec(&r->plan));
}

static const struct {
    const char *stage;
    enum plan_part first, last;
} stages[] = {
    {"prepare", PLAN_PREPARE, PLAN_PREPARE}, {"fuse", PLAN_FUSE, PLAN_FUSE},       {"solve", PLAN_GATHER, PLAN_DETAIL},
    {"refine", PLAN_REFINE, PLAN_REFINE},    {"report", PLAN_REPORT, PLAN_REPORT},
};

void pace_advance(struct reconstruction *r, const struct reconstruct_hooks *hooks, const char *stage,
                  enum plan_part part, double work) {
    plan_advance(&r->plan, part, work, hooks->worked_sec(hooks->user));
    if (!isinf(r->plan.limit_sec))
        plan_fit(&r->plan);
    for (size_t i = 0; i < sizeof stages / sizeof *stages; i++)
        if (strcmp(stages[i].stage, stage) == 0)
            hooks->progress(hooks->user, stage, plan_share_done(&r->plan, stages[i].first, stages[i].last), 1.0,
                            plan_left_sec(&r->plan));
}

/* --- report ------------------------------------------------------------------------------------- */

static const struct {
    enum plan_part part;
    const char *name, *unit, *of_all; /* of_all: what a cut leaves out, in words; NULL: never cut */
} report_parts[] = {
    {PLAN_PREPARE, "prepare", "whole", NULL},
    {PLAN_FUSE, "fuse", "whole", NULL},
    {PLAN_GATHER, "gather", "directions", "of the directions of gathered light"},
    {PLAN_FIT, "fit", "whole", NULL},
    {PLAN_MEASURE, "measure", "texels", "of the texels whose base colour is measured"},
    {PLAN_DETAIL, "detail", "texel steps", "of the detail finer than pixels"},
    {PLAN_REFINE, "refine", "observations", "of refine's observations"},
    {PLAN_REPORT, "report", "paths", "of the samples of the held-out re-renders"},
};
#define REPORT_PARTS (sizeof report_parts / sizeof *report_parts)

static void report_work(struct reconstruction *r) {
    cJSON *work = cJSON_AddArrayToObject(r->report, "work");
    for (size_t i = 0; i < REPORT_PARTS; i++) {
        const struct plan_work *w = &r->plan.part[report_parts[i].part];
        cJSON *entry = cJSON_CreateObject();
        json_add_string(entry, "part", report_parts[i].name);
        json_add_string(entry, "unit", report_parts[i].unit);
        json_add_number(entry, "done", w->done);
        json_add_number(entry, "working_seconds_this_attempt", w->spent_sec);
        cJSON_AddItemToArray(work, entry);
    }
}

static void report_left_out(struct reconstruction *r, cJSON *list) {
    char *text = r->left_out;
    size_t size = sizeof r->left_out, used = 0;
    for (size_t i = 0; i < REPORT_PARTS; i++) {
        const struct plan_work *w = &r->plan.part[report_parts[i].part];
        if (!report_parts[i].of_all || !plan_is_cut(&r->plan, report_parts[i].part))
            continue;
        double share = 1.0 - w->now / w->wanted;
        cJSON *entry = cJSON_CreateObject();
        json_add_string(entry, "part", report_parts[i].name);
        json_add_string(entry, "unit", report_parts[i].unit);
        json_add_number(entry, "asked_for", w->wanted);
        json_add_number(entry, "done", w->now);
        cJSON_AddItemToArray(list, entry);
        if (used < size)
            used += (size_t)snprintf(
                text + used, size - used, "%s%.0f %% %s", used ? ", " : "left out to keep time_limit_sec: ",
                share < 1.0 ? fmin(fmax(100.0 * share, 1.0), 99.0) : 100.0, report_parts[i].of_all);
    }
    if (!plan_is_kept(&r->plan) && used < size)
        snprintf(text + used, size - used, "%sthe job took %.0f s in place of time_limit_sec=%.0f", used ? "; " : "",
                 r->plan.used_sec + plan_left_sec(&r->plan), r->plan.limit_sec);
}

void pace_report(struct reconstruction *r, const struct reconstruct_hooks *hooks) {
    report_work(r);
    if (isinf(r->plan.limit_sec))
        return;
    cJSON *limit = cJSON_AddObjectToObject(r->report, "time_limit");
    json_add_number(limit, "limit_sec", r->plan.limit_sec);
    json_add_number(limit, "used_sec", r->plan.used_sec);
    json_add_bool(limit, "kept", plan_is_kept(&r->plan));
    report_left_out(r, cJSON_AddArrayToObject(limit, "left_out"));
    json_add_string(limit, "summary", r->left_out[0] ? r->left_out : "nothing was left out");
    if (r->left_out[0])
        hooks->warning(hooks->user, r->left_out);
}
