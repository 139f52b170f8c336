/* reconstruct.c -- the stages in their order; see reconstruct.h. */
#include "server/reconstruct/reconstruct.h"

#include <math.h>
#include <stdio.h>

#include "common/clock.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "server/capture/views.h"
#include "server/light/emitters.h"
#include "server/light/light_estimate.h"
#include "server/light/openings.h"
#include "server/light/sky/unseen_light.h"
#include "server/light/sun/sun_find.h"
#include "server/light/unseen_lamps.h"
#include "server/material/emission_pattern.h"
#include "server/material/plain_spread.h"
#include "server/reconstruct/inputs.h"
#include "server/reconstruct/prepare.h"
#include "server/reconstruct/report.h"
#include "server/reconstruct/solve.h"
#include "server/refine/listing1.h"
#include "server/refine/refine.h"
#include "server/state/evidence.h"
#include "server/state/pace.h"

struct stage_run {
    struct reconstruction *r;
    const struct reconstruct_hooks *hooks;
    struct pace pace;
    struct views views;
    struct optimiser *optimiser; /* of listing1 or refine; owned */
    cJSON *stages;               /* owned by the report */
};

/* Announces a stage, runs it, records its time. */
static enum status run_stage(struct stage_run *run, const char *name,
                             enum status (*stage)(struct stage_run *, struct error *), struct error *err) {
    double begin = clock_sec();
    run->hooks->stage(run->hooks->user, name);
    pace_begin_stage(&run->pace, name);
    enum status status = stage(run, err);
    cJSON *entry = cJSON_CreateObject();
    json_add_string(entry, "name", name);
    json_add_number(entry, "seconds", clock_sec() - begin);
    cJSON_AddItemToArray(run->stages, entry);
    if (status == STATUS_OK && run->hooks->stop_requested(run->hooks->user))
        status = error_set(err, STATUS_CANCELLED, "stopped after stage %s", name);
    return status;
}

static enum status preview_if_due(struct stage_run *run, struct error *err) {
    const struct reconstruct_hooks *hooks = run->hooks;
    return hooks->preview_due(hooks->user) ? hooks->preview(hooks->user, run->r, err) : STATUS_OK;
}

/* Logs the hidden lamps and the sun. */
static void log_hidden_lights(const struct stage_run *run) {
    const struct reconstruction *r = run->r;
    size_t lamps = 0;
    char line[128];
    for (size_t i = 0; i < r->segments.count; i++)
        lamps += r->evidence[i].is_hidden && !segment_range_has(&r->openings, i);
    snprintf(line, sizeof line, "light: %zu lamps that no photograph shows were found by what they light", lamps);
    if (lamps > 0)
        run->hooks->log(run->hooks->user, line);
    snprintf(line, sizeof line, "light: it comes in at %zu places where nothing was scanned", r->openings.count);
    if (r->openings.count > 0)
        run->hooks->log(run->hooks->user, line);
    if (r->sun.is_there && !r->sun.is_measured)
        run->hooks->log(run->hooks->user, "light: a sun that no photograph measures was found by what it lights");
}

static enum status prepare(struct stage_run *run, struct error *err) {
    return prepare_run(run->r, &run->views, &run->pace, err);
}

/* Makes again what was made of the mesh, and fuses again what photographs show, if surface was added to it. All that
 * was added, the triangles from `scanned` on, is coarse. */
static enum status take_up_surface(struct stage_run *run, bool was_added, size_t scanned, struct error *err) {
    struct reconstruction *r = run->r;
    if (!was_added)
        return STATUS_OK;
    fused_release(&r->fused);
    enum status status = prepare_again(r, &run->views, r->scene->mesh.triangle_count - scanned, err);
    if (status == STATUS_OK)
        fuse(&r->fused, &run->views, &r->noise, &r->atlas, &r->inverse, r->pool);
    return status;
}

/* Adds surface from which light comes where a scan has none. */
static enum status find_unscanned(struct stage_run *run, struct error *err) {
    size_t scanned = run->r->scene->mesh.triangle_count;
    enum status status = take_up_surface(run, openings_find(run->r, &run->views) > 0, scanned, err);
    if (status == STATUS_OK)
        status = take_up_surface(run, unseen_lamps_find(run->r, &run->views) > 0, scanned, err);
    return status;
}

static enum status fuse_photographs(struct stage_run *run, struct error *err) {
    fuse(&run->r->fused, &run->views, &run->r->noise, &run->r->atlas, &run->r->inverse, run->r->pool);
    enum status status = find_unscanned(run, err);
    if (status != STATUS_OK)
        return status;
    prepare_report_surface(run->r);
    light_estimate(run->r, &run->views);
    unseen_light_estimate(run->r, &run->views);
    sun_find(run->r, &run->views);
    log_hidden_lights(run);
    if (run->r->sun.is_there && !run->r->environment.map.pixel)
        environment_make_unseen(&run->r->environment); /* the sun is drawn there after solve */
    if (run->r->environment.map.pixel)
        json_add(run->r->report, "environment", environment_figures(&run->r->environment));
    mem_free(run->r->radiance_preview);
    run->r->radiance_preview = NULL;
    pace_advance(&run->pace, "fuse", PLAN_FUSE, 1.0);
    return preview_if_due(run, err);
}

static enum status solve(struct stage_run *run, struct error *err) {
    enum status status = solve_run(run->r, &run->views, &run->pace, err);
    return status == STATUS_OK ? refine_start(run->optimiser, err) : status;
}

static enum status optimise(struct stage_run *run, struct error *err) { return optimiser_run(run->optimiser, err); }

/* Checkpoints do not contain emission patterns. */
static void restore_patterns(struct stage_run *run) {
    const struct emission_pattern_input input = inputs_of_pattern(run->r, &run->views);
    emission_pattern_restore(&input, &run->r->materials, run->r->evidence);
}

static struct optimiser *optimiser_of_method(struct stage_run *run) {
    struct reconstruction *r = run->r;
    const struct optimiser_input input = inputs_of_optimiser(r, &run->views, &run->pace);
    if (settings_is(r->settings, "method", "solve"))
        return refine_new(&input, &r->fused, &r->noise);
    emitters_observe(r, &run->views, r->evidence);
    return listing1_new(&input);
}

/* What the stated deviations of base colour are at least. */
static void measure_spread(struct reconstruction *r) {
    const struct surface surface = reconstruction_surface(r);
    float spread = plain_spread(&surface, &r->materials.base_color, r->fused.count, r->is_emitter);
    r->materials.spread = hypotf(isfinite(spread) ? spread : MATERIALS_SPREAD, r->light.deviation);
}

/* The stages that checkpoints cover; those that are done are skipped. */
static enum status run_resumable(struct stage_run *run, struct error *err) {
    bool found = false, solves = settings_is(run->r->settings, "method", "solve");
    run->optimiser = optimiser_of_method(run);
    enum status status = optimiser_load(run->optimiser, &found, err);
    if (status == STATUS_OK && solves && !found)
        status = run_stage(run, "solve", solve, err);
    bool was_solved = status == STATUS_OK && solves && found;
    run->r->has_materials = status == STATUS_OK;
    if (was_solved)
        light_restore(run->r);
    if (was_solved)
        restore_patterns(run);
    if (run->r->sun.is_there) {
        sun_report(run->r);
        sun_draw(&run->r->sun, &run->r->environment);
        prepare_environment(run->r);
    }
    if (status == STATUS_OK) {
        measure_spread(run->r);
        status = run_stage(run, "refine", optimise, err);
    }
    optimiser_free(run->optimiser);
    return status;
}

/* A room of which photographs show something has light; where none was found, all is black in it, and base colours are
 * what is left of a division by nothing. */
static void report_lit(const struct stage_run *run) {
    const struct reconstruction *r = run->r;
    bool is_lit = r->sun.is_there || (r->environment.map.pixel && r->environment.luminance > 0.0);
    for (size_t i = 0; i < r->segments.count; i++)
        is_lit = is_lit || r->is_emitter[i];
    json_add_bool(r->report, "lit", is_lit);
    if (!is_lit)
        run->hooks->log(run->hooks->user, "light: nothing that shines was found: renders are black, and base colours "
                                          "mean nothing. Is the mesh that of the photographs?");
}

static enum status report(struct stage_run *run, struct error *err) {
    measure_spread(run->r);
    world_update_lights(&run->r->world);
    report_lit(run);
    report_emitters(run->r);
    light_report(run->r);
    report_grey_card(run->r, run->hooks);
    report_luminance(run->r, run->hooks);
    enum status status = report_held_out(run->r, &run->views, &run->pace, err);
    json_add_number(run->r->report, "base_color_deviation", (double)run->r->materials.spread);
    plan_close(&run->r->plan, PLAN_REPORT);
    if (status == STATUS_OK)
        pace_report(&run->pace, run->r->report, run->r->left_out, sizeof run->r->left_out);
    return status;
}

enum status reconstruct_run(struct scene *scene, const struct settings *settings, struct parallel *pool,
                            const struct reconstruct_hooks *hooks, struct reconstruction *r, struct error *err) {
    *r = (struct reconstruction){.scene = scene, .settings = settings, .pool = pool, .sky_factor = rgb_gray(1.0f)};
    r->report = cJSON_CreateObject();
    json_add_string(r->report, "unbake_version", UNBAKE_VERSION);
    json_add_string(r->report, "ray_library", accel_library_version());
    json_add(r->report, "settings", settings_to_json(settings));
    struct stage_run run = {.r = r, .hooks = hooks, .pace = {&r->plan, settings, hooks, parallel_thread_count(pool)}};
    run.stages = cJSON_AddArrayToObject(r->report, "stages");
    pace_start(&run.pace, scene);
    enum status status = run_stage(&run, "prepare", prepare, err);
    if (status == STATUS_OK)
        status = run_stage(&run, "fuse", fuse_photographs, err);
    if (status == STATUS_OK)
        status = run_resumable(&run, err);
    if (status == STATUS_OK)
        status = run_stage(&run, "report", report, err);
    views_release(&run.views);
    return status;
}

void reconstruct_release(struct reconstruction *r) {
    report_release_held_out(r);
    mem_free(r->radiance_preview);
    mem_free(r->is_emitter);
    mem_free(r->evidence);
    environment_release(&r->environment);
    noise_release(&r->noise);
    fused_release(&r->fused);
    world_release(&r->world);
    materials_release(&r->materials);
    inverse_uv_release(&r->inverse);
    atlas_release(&r->atlas);
    segments_release(&r->segments);
    cJSON_Delete(r->report);
    *r = (struct reconstruction){0};
}
