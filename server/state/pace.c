/* pace.c -- see pace.h.
 *
 * Priors are processor seconds of one core, measured on staircase2 at 2048 and on the demo room at 512 texels a side
 * (which differ by up to a factor of 2), on a loaded virtual machine of two cores. They only serve the first forecasts;
 * measurements of the run replace them (plan.h). */
#include "server/state/pace.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/kept_pixels.h"
#include "common/parallel.h"
#include "server/gather/probes_refine.h"
#include "server/scene/photograph_reduce.h"
#include "server/state/held_out_size.h"

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
/* Parts that a time limit leaves of each before it cuts the next (plan.h). Either has three times the noise then. */
#define MODEST_OBSERVATIONS 0.1
#define MODEST_REPORT 0.125
#define MIN_MEASURE 0.25 /* one texel in 2 x 2 */

static double side(const struct pace *p) { return settings_number(p->settings, "texture_size"); }

static bool solves(const struct pace *p) { return settings_is(p->settings, "method", "solve"); }

/* The setting that says how many observations are wanted. */
static const char *observations_setting(const struct pace *p) { return solves(p) ? "refine_looks" : "listing1_looks"; }

double pace_observations_wanted(const struct pace *p, const struct inverse_uv *inverse) {
    const char *name = observations_setting(p);
    double observations = settings_number(p->settings, name);
    if (observations == 0.0)
        observations = isinf(p->plan->limit_sec) ? settings_of_quality(p->settings, name) : (double)INFINITY;
    uint32_t larger = inverse->width > inverse->height ? inverse->width : inverse->height;
    double window = larger > WINDOWS_ACROSS ? (double)(larger / WINDOWS_ACROSS) : 1.0;
    return observations * ceil((double)inverse->valid_count / (window * window));
}

static void plan_refine(const struct pace *p, double wanted, double modest) {
    double sec = settings_number(p->settings, "samples_per_camera") * REFINE_PATH_SEC / p->thread_count;
    plan_set(p->plan, PLAN_REFINE, wanted, MODEST_OBSERVATIONS * modest, 0.0, solves(p) ? sec : LISTING1_FACTOR * sec);
}

void pace_plan_observations(const struct pace *p, double observations) { plan_refine(p, observations, observations); }

static void plan_report(const struct pace *p, double pixels) {
    double samples = settings_number(p->settings, "report_samples");
    plan_set(p->plan, PLAN_REPORT, pixels * samples, pixels * fmax(ceil(MODEST_REPORT * samples), 1.0), pixels,
             REPORT_SEC / p->thread_count);
}

void pace_plan_solve(const struct pace *p, double valid, double directions, double early_texels, double last_texels,
                     double detail_steps) {
    double n = p->thread_count;
    plan_set(p->plan, PLAN_GATHER, directions, directions, PACE_MIN_GATHER * directions, GATHER_SEC / n);
    plan_set(p->plan, PLAN_MEASURE, early_texels + last_texels, early_texels + last_texels,
             early_texels + MIN_MEASURE * last_texels, MEASURE_SEC / n);
    plan_set(p->plan, PLAN_DETAIL, detail_steps, detail_steps, 0.0, DETAIL_SEC / n);
    plan_set_fixed(p->plan, PLAN_FIT, 1.0,
                   (FIT_SPECULAR_SEC * settings_number(p->settings, "gloss_passes") + FIT_TEXEL_SEC * valid) / n);
    plan_fit(p->plan);
}

/* Plans everything that depends on the number of mapped texels. */
static void plan_texels(const struct pace *p, double valid) {
    double n = p->thread_count, stride = settings_number(p->settings, "measure_stride");
    plan_set_fixed(p->plan, PLAN_FUSE, 1.0, (FUSE_SEC + FUSE_TEXEL_SEC * valid) / n);
    plan_set_fixed(p->plan, PLAN_EXPORT, 1.0, EXPORT_TEXEL_SEC * side(p) * side(p)); /* on one core, mostly */
    if (!solves(p))
        return;
    double spacing = (double)probes_spacing((uint32_t)side(p));
    double probes = USUAL_PROBES * valid / (spacing * spacing), texels = valid / (stride * stride);
    /* Two passes with a quarter of the directions come before the last. */
    double more = 1.0 + PROBES_REFINED_SHARE, passes = 0.25 + 0.25 * more + more * more;
    pace_plan_solve(p, valid, passes * probes * settings_number(p->settings, "gather_samples"), 0.5 * texels, texels,
                    settings_number(p->settings, "detail_steps") * valid);
}

static void plan_all(const struct pace *p, const struct scene *scene) {
    double pixels = 0.0, held_out = held_out_pixels(scene), every = settings_number(p->settings, "hold_out_every");
    plan_init(p->plan, settings_number(p->settings, "time_limit_sec"));
    for (size_t i = 0; i < scene->photograph_count; i++) {
        struct camera c = photograph_file_camera(&scene->photograph[i]);
        double step = (double)camera_step_to(&c, kept_pixels(p->settings, side(p)));
        pixels += (double)c.width * (double)c.height / (step * step);
    }
    if (held_out == 0.0 && every > 0.0)
        held_out = held_out_pixels_of_all(scene) / every;
    double valid = USUAL_COVER * side(p) * side(p);
    plan_set_fixed(p->plan, PLAN_PREPARE, 1.0,
                   (PREPARE_SEC + PREPARE_PIXEL_SEC * pixels + PREPARE_TEXEL_SEC * side(p) * side(p)) /
                       p->thread_count);
    plan_texels(p, valid);
    double windows = USUAL_COVER * WINDOWS_ACROSS * WINDOWS_ACROSS;
    const char *name = observations_setting(p);
    plan_refine(p, windows * settings_number(p->settings, name), windows * settings_of_quality(p->settings, name));
    plan_report(p, held_out);
}

void pace_start(const struct pace *p, const struct scene *scene) {
    plan_all(p, scene);
    plan_pass_time(p->plan, p->hooks->worked_sec(p->hooks->user)); /* reading the scene */
}

double pace_forecast_sec(const struct scene *scene, const struct settings *settings, struct parallel *pool) {
    struct plan plan;
    plan_all(&(struct pace){&plan, settings, NULL, parallel_thread_count(pool)}, scene);
    return plan_left_sec(&plan);
}

void pace_measure_room(const struct pace *p, const struct scene *scene, const struct inverse_uv *inverse) {
    double wanted = pace_observations_wanted(p, inverse);
    const char *name = observations_setting(p);
    plan_texels(p, (double)inverse->valid_count);
    double usual = isinf(wanted) ? settings_of_quality(p->settings, name) * WINDOWS_ACROSS * WINDOWS_ACROSS : wanted;
    plan_refine(p, wanted, usual);
    plan_report(p, held_out_pixels(scene));
}

void pace_begin_stage(const struct pace *p, const char *stage) {
    const struct reconstruct_hooks *hooks = p->hooks;
    plan_pass_time(p->plan, hooks->worked_sec(hooks->user));
    hooks->progress(hooks->user, stage, 0.0, 1.0, plan_left_sec(p->plan));
}

static const struct {
    const char *stage;
    enum plan_part first, last;
} stages[] = {
    {"prepare", PLAN_PREPARE, PLAN_PREPARE}, {"fuse", PLAN_FUSE, PLAN_FUSE},       {"solve", PLAN_GATHER, PLAN_DETAIL},
    {"refine", PLAN_REFINE, PLAN_REFINE},    {"report", PLAN_REPORT, PLAN_REPORT},
};

void pace_advance(const struct pace *p, const char *stage, enum plan_part part, double work) {
    const struct reconstruct_hooks *hooks = p->hooks;
    plan_advance(p->plan, part, work, hooks->worked_sec(hooks->user));
    if (!isinf(p->plan->limit_sec))
        plan_fit(p->plan);
    for (size_t i = 0; i < sizeof stages / sizeof *stages; i++)
        if (strcmp(stages[i].stage, stage) == 0)
            hooks->progress(hooks->user, stage, plan_share_done(p->plan, stages[i].first, stages[i].last), 1.0,
                            plan_left_sec(p->plan));
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

static void report_work(const struct plan *plan, cJSON *report) {
    cJSON *work = cJSON_AddArrayToObject(report, "work");
    for (size_t i = 0; i < REPORT_PARTS; i++) {
        const struct plan_work *w = &plan->part[report_parts[i].part];
        cJSON *entry = cJSON_CreateObject();
        json_add_string(entry, "part", report_parts[i].name);
        json_add_string(entry, "unit", report_parts[i].unit);
        json_add_number(entry, "done", w->done);
        json_add_number(entry, "working_seconds_this_attempt", w->spent_sec);
        cJSON_AddItemToArray(work, entry);
    }
}

/* Lists what was left out, and writes it as a sentence to text[size]. */
static void report_left_out(const struct plan *plan, cJSON *list, char *text, size_t size) {
    size_t used = 0;
    for (size_t i = 0; i < REPORT_PARTS; i++) {
        const struct plan_work *w = &plan->part[report_parts[i].part];
        if (!report_parts[i].of_all || !plan_is_cut(plan, report_parts[i].part))
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
    if (!plan_is_kept(plan) && used < size)
        snprintf(text + used, size - used, "%sthe job took %.0f s in place of time_limit_sec=%.0f", used ? "; " : "",
                 plan->used_sec + plan_left_sec(plan), plan->limit_sec);
}

void pace_report(const struct pace *p, cJSON *report, char *left_out, size_t size) {
    const struct plan *plan = p->plan;
    left_out[0] = '\0';
    report_work(plan, report);
    if (isinf(plan->limit_sec))
        return;
    cJSON *limit = cJSON_AddObjectToObject(report, "time_limit");
    json_add_number(limit, "limit_sec", plan->limit_sec);
    json_add_number(limit, "used_sec", plan->used_sec);
    json_add_bool(limit, "kept", plan_is_kept(plan));
    report_left_out(plan, cJSON_AddArrayToObject(limit, "left_out"), left_out, size);
    json_add_string(limit, "summary", left_out[0] ? left_out : "nothing was left out");
    if (left_out[0])
        p->hooks->warning(p->hooks->user, left_out);
}
