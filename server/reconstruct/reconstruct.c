/* reconstruct.c -- the stages in their order; see reconstruct.h. */
#include "server/reconstruct/reconstruct.h"

#include <stdio.h>
#include <string.h>

#include "common/clock.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "server/capture/clip.h"
#include "server/capture/environment_gather.h"
#include "server/capture/fireflies.h"
#include "server/capture/orient.h"
#include "server/capture/radiance_preview.h"
#include "server/capture/seen_share.h"
#include "server/capture/texel_density.h"
#include "server/capture/views.h"
#include "server/light/emitters.h"
#include "server/light/lamp_find.h"
#include "server/light/lamps.h"
#include "server/light/saturated_light.h"
#include "server/light/split.h"
#include "server/light/sun_find.h"
#include "server/light/unseen_light.h"
#include "server/material/emission_pattern.h"
#include "server/reconstruct/calibrate.h"
#include "server/reconstruct/inputs.h"
#include "server/reconstruct/report.h"
#include "server/reconstruct/solve.h"
#include "server/refine/listing1.h"
#include "server/refine/refine.h"
#include "server/scene/mesh_denoise.h"
#include "server/scene/normals.h"
#include "server/state/evidence.h"
#include "server/state/pace.h"

/* Initial material, with NEUTRAL_BASE_COLOR. By hand. */
#define NEUTRAL_ROUGHNESS 0.5f
#define NEUTRAL_SPECULAR 0.5f

#define MIN_TRAINING 16 /* training photographs that must remain for any to be held out */

/* Parts of the time of prepare, measured on staircase2 at 2048 x 2048: atlas; visibility; calibration. The rest is the
 * second atlas. */
#define MAP_SHARE 0.08
#define VIEWS_SHARE 0.06
#define CALIBRATE_SHARE 0.72

struct stage_run {
    struct reconstruction *r;
    const struct reconstruct_hooks *hooks;
    struct pace pace;
    struct views views;
    struct optimiser *optimiser; /* of listing1 or refine; owned */
    size_t flipped;              /* flipped triangles */
    const char *normals;         /* their source: given, estimated, none */
    float mesh_noise_m;          /* standard deviation of the vertices' noise; 0: not denoised */
    float roughness;             /* of a mesh whose normals are estimated */
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

/* Holds photographs out for the report if the capture itself holds out none, and if MIN_TRAINING remain for
 * training. */
static void hold_out(struct reconstruction *r) {
    struct scene *scene = r->scene;
    size_t every = (size_t)settings_number(r->settings, "hold_out_every");
    for (size_t i = 0; i < scene->photograph_count; i++) {
        if (scene->photograph[i].is_test)
            return;
    }
    if (every == 0 || scene->photograph_count - scene->photograph_count / every < MIN_TRAINING)
        return;
    for (size_t i = every - 1; i < scene->photograph_count; i += every)
        scene->photograph[i].is_test = true;
}

static void make_segments(struct reconstruction *r) {
    const struct mesh *mesh = &r->scene->mesh;
    bool given = mesh->object_id && !settings_is(r->settings, "segmentation", "automatic");
    if (given)
        segments_from_object_id(&r->segments, mesh);
    else
        segments_automatic(&r->segments, mesh);
    json_add_string(r->report, "segmentation", given ? "given" : "automatic");
}

static void add_prepare_figures(const struct stage_run *run) {
    const struct reconstruction *r = run->r;
    const struct mesh *mesh = &r->scene->mesh;
    cJSON *figures = cJSON_AddObjectToObject(r->report, "prepare");
    json_add_int(figures, "triangles", (int64_t)mesh->triangle_count);
    json_add_int(figures, "degenerate_triangles_dropped", (int64_t)r->scene->mesh_report.degenerate_count);
    json_add_int(figures, "duplicate_triangles_dropped", (int64_t)r->scene->mesh_report.duplicate_count);
    json_add_int(figures, "triangles_turned", (int64_t)run->flipped);
    json_add_string(figures, "normals", run->normals);
    json_add_number(figures, "mesh_noise_m", (double)run->mesh_noise_m);
    json_add_number(figures, "mesh_roughness", (double)run->roughness);
    json_add_int(figures, "segments", (int64_t)r->segments.count);
    json_add_int(figures, "charts", (int64_t)r->atlas.chart_count);
    json_add_int(figures, "texture_width", r->atlas.width);
    json_add_int(figures, "texture_height", r->atlas.height);
    json_add_number(figures, "texels_per_metre", (double)r->atlas.texels_per_metre);
    json_add_int(figures, "valid_texels", (int64_t)r->inverse.valid_count);
    json_add_number(figures, "atlas_utilisation",
                    (double)r->inverse.valid_count / ((double)r->atlas.width * (double)r->atlas.height));
    json_add_int(figures, "training_photographs", (int64_t)run->views.train_count);
    json_add_number(figures, "median_radiance", (double)run->views.median_radiance);
}

/* Makes everything that depends on the segments. density[triangle_count]: texture density (atlas_make_uneven), or
 * NULL. */
static enum status map_surface(struct reconstruction *r, const float *density, struct error *err) {
    const struct mesh *mesh = &r->scene->mesh;
    uint32_t size = (uint32_t)settings_number(r->settings, "texture_size");
    float texels_per_metre = (float)settings_number(r->settings, "texels_per_metre");
    enum status status = density ? atlas_make_uneven(&r->atlas, mesh, &r->segments, size, density, err)
                                 : atlas_make(&r->atlas, mesh, &r->segments, size, texels_per_metre, err);
    if (status != STATUS_OK)
        return status;
    inverse_uv_make(&r->inverse, &r->atlas, mesh->triangle_count, r->pool);
    materials_init(&r->materials, &r->inverse, r->segments.count, rgb_gray(NEUTRAL_BASE_COLOR), NEUTRAL_ROUGHNESS,
                   NEUTRAL_SPECULAR);
    r->is_emitter = mem_calloc(r->segments.count, sizeof *r->is_emitter);
    r->evidence = mem_calloc(r->segments.count, sizeof *r->evidence);
    return world_init(&r->world, mesh, &r->segments, &r->atlas, &r->materials, NULL, r->pool, err);
}

static void release_surface(struct reconstruction *r) {
    world_release(&r->world);
    mem_free(r->evidence);
    mem_free(r->is_emitter);
    r->evidence = NULL;
    r->is_emitter = NULL;
    materials_release(&r->materials);
    inverse_uv_release(&r->inverse);
    atlas_release(&r->atlas);
}

static void light_by_environment(struct reconstruction *r) {
    if (r->environment.map.pixel)
        world_set_environment(&r->world, &r->environment.map, r->pool);
}

static void report_split(const struct stage_run *run, const struct split *split) {
    cJSON *list = cJSON_AddArrayToObject(run->r->report, "parts_that_shine");
    for (size_t i = 0; i < split->part_count; i++) {
        cJSON *entry = cJSON_CreateObject();
        json_add_int(entry, "segment", (int64_t)(split->old_count + i));
        json_add_int(entry, "of_segment", (int64_t)split->whole[i]);
        cJSON_AddItemToArray(list, entry);
    }
    char line[128];
    snprintf(line, sizeof line, "segments: %zu parts that shine were split off, as segments of their own",
             split->part_count);
    if (split->part_count > 0)
        run->hooks->log(run->hooks->user, line);
}

/* Splits bright parts off their segments; true when there were any. */
static bool split_bright_parts(struct stage_run *run) {
    struct split split;
    split_segments(&split, run->r, &run->views);
    report_split(run, &split);
    bool any = split.part_count > 0;
    split_release(&split);
    return any;
}

/* Makes the atlas again, with the split segments and a density by visibility. */
static enum status remap_surface(struct stage_run *run, bool has_split, struct error *err) {
    struct reconstruction *r = run->r;
    bool even = settings_number(r->settings, "texels_per_metre") > 0.0;
    if (even && !has_split)
        return STATUS_OK;
    float *density = even ? NULL : mem_array(r->scene->mesh.triangle_count, sizeof *density);
    if (density)
        texel_density_from_views(&run->views, &r->atlas, r->pool, density);
    release_surface(r);
    mem_free(r->radiance_preview); /* of the former atlas */
    r->radiance_preview = NULL;
    enum status status = map_surface(r, density, err);
    mem_free(density);
    if (status != STATUS_OK)
        return status;
    views_update_segments(&run->views, r->world.accel, r->pool);
    light_by_environment(r);
    return STATUS_OK;
}

static void denoise_mesh(struct stage_run *run) {
    char line[128];
    if (settings_bool(run->r->settings, "denoise_mesh"))
        run->mesh_noise_m = mesh_denoise(&run->r->scene->mesh, run->r->pool);
    if (run->mesh_noise_m == 0.0f)
        return;
    snprintf(line, sizeof line, "mesh: its vertices are off by %.2g mm; they were put back",
             1e3 * (double)run->mesh_noise_m);
    run->hooks->log(run->hooks->user, line);
}

static void estimate_normals(struct stage_run *run) {
    struct mesh *mesh = &run->r->scene->mesh;
    bool had_some = mesh->normal != NULL;
    if (normals_estimate(mesh, run->r->pool, &run->roughness) && !had_some)
        run->hooks->log(run->hooks->user, "mesh: it has no normals; they are estimated");
    run->normals = had_some ? "given" : mesh->normal ? "estimated" : "none";
}

static enum status preview_if_due(struct stage_run *run, struct error *err) {
    const struct reconstruct_hooks *hooks = run->hooks;
    return hooks->preview_due(hooks->user) ? hooks->preview(hooks->user, run->r, err) : STATUS_OK;
}

/* A first preview, before the slow steps. */
static enum status show_radiance(struct stage_run *run, struct error *err) {
    struct reconstruction *r = run->r;
    if (!run->hooks->preview_due(run->hooks->user))
        return STATUS_OK;
    r->radiance_preview = radiance_preview(&run->views, &r->atlas, &r->inverse, r->pool);
    return preview_if_due(run, err);
}

/* Reports a part of prepare as done. */
static void prepare_advance(struct stage_run *run, double share) {
    pace_advance(&run->pace, "prepare", PLAN_PREPARE, share);
}

/* The segments that settings name must be there. */
static enum status check_segment_settings(const struct reconstruction *r, struct error *err) {
    for (size_t i = 0; i < r->settings->segment_count; i++) {
        uint32_t segment = r->settings->segment[i].segment;
        if (segment >= r->segments.count)
            return error_set(err, STATUS_INPUT, "emitters.%u: there are %zu segments, from 0", segment,
                             r->segments.count);
    }
    return STATUS_OK;
}

/* Ends a job that could measure next to nothing before it takes minutes. */
static enum status require_seen_surface(struct stage_run *run, struct error *err) {
    struct seen_share share = seen_share_measure(&run->views, run->r->pool);
    json_add_number(run->r->report, "seen_surface_share", share.surface);
    return seen_share_require(&share, settings_is(run->r->settings, "fit", "ignore"), err);
}

/* Room for what is found of each pixel of the photographs that are used. */
static enum status reserve_pixels(const struct reconstruction *r, struct error *err) {
    size_t count = 0;
    uint64_t pixels = 0;
    for (size_t i = 0; i < r->scene->photograph_count; i++) {
        const struct photograph *photo = &r->scene->photograph[i];
        count += !photo->is_test;
        pixels += photo->is_test ? 0 : (uint64_t)photo->camera.width * photo->camera.height;
    }
    return spill_reserve(r->scene->spill, "the classes of the photographs' pixels", PHOTOGRAPH_LATER_BYTES * count,
                         PHOTOGRAPH_LATER_BYTES * pixels, 0, err);
}

static enum status prepare(struct stage_run *run, struct error *err) {
    struct reconstruction *r = run->r;
    const struct mesh *mesh = &r->scene->mesh;
    if (settings_is(r->settings, "segmentation", "given") && !mesh->object_id)
        return error_set(err, STATUS_INPUT, "segmentation=given, but the mesh has no object_id per face");
    hold_out(r);
    enum status status = reserve_pixels(r, err);
    if (status == STATUS_OK)
        status = orient_mesh(r->scene, r->pool, &run->flipped, err);
    if (status != STATUS_OK)
        return status;
    denoise_mesh(run);
    estimate_normals(run);
    make_segments(r);
    status = map_surface(r, NULL, err);
    if (status != STATUS_OK)
        return status;
    prepare_advance(run, MAP_SHARE);
    views_init(&run->views, r->scene, &r->segments, r->world.accel, r->pool);
    prepare_advance(run, VIEWS_SHARE);
    status = require_seen_surface(run, err);
    if (status == STATUS_OK)
        status = show_radiance(run, err);
    if (status != STATUS_OK)
        return status;
    calibrate(r, &run->views, run->hooks);
    noise_measure(&r->noise, &run->views);
    noise_set_black(&r->noise, r->scene);
    clip_mark(r->scene, &run->views, &r->noise, r->pool);
    fireflies_mark(r->scene, &run->views, &r->noise, r->pool);
    environment_gather(&r->environment, &run->views, r->pool);
    light_by_environment(r);
    prepare_advance(run, CALIBRATE_SHARE);
    status = remap_surface(run, split_bright_parts(run), err);
    add_prepare_figures(run);
    pace_measure_room(&run->pace, r->scene, &r->inverse);
    prepare_advance(run, 1.0 - MAP_SHARE - VIEWS_SHARE - CALIBRATE_SHARE);
    return status == STATUS_OK ? check_segment_settings(r, err) : status;
}

/* Logs the hidden lamps and the sun. */
static void log_hidden_lights(const struct stage_run *run) {
    const struct reconstruction *r = run->r;
    size_t lamps = 0;
    char line[128];
    for (size_t i = 0; i < r->segments.count; i++)
        lamps += r->evidence[i].is_hidden;
    snprintf(line, sizeof line, "light: %zu lamps that no photograph shows were found by what they light", lamps);
    if (lamps > 0)
        run->hooks->log(run->hooks->user, line);
    if (r->sun.is_there)
        run->hooks->log(run->hooks->user, "light: a sun that no photograph shows was found by what it lights");
}

static enum status fuse_photographs(struct stage_run *run, struct error *err) {
    fuse(&run->r->fused, &run->views, &run->r->noise, &run->r->atlas, &run->r->inverse, run->r->pool);
    saturated_light_estimate(run->r, &run->views);
    lamp_find(run->r, &run->views);
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

/* The stages that checkpoints cover; those that are done are skipped. */
static enum status run_resumable(struct stage_run *run, struct error *err) {
    bool found = false, solves = settings_is(run->r->settings, "method", "solve");
    run->optimiser = optimiser_of_method(run);
    enum status status = optimiser_load(run->optimiser, &found, err);
    if (status == STATUS_OK && solves && !found)
        status = run_stage(run, "solve", solve, err);
    bool was_solved = status == STATUS_OK && solves && found;
    run->r->has_materials = status == STATUS_OK;
    if (was_solved && rgb_mean(run->r->sky_factor) != 1.0f) /* checkpoints hold this factor instead of the map */
        lamps_brighten_sky(run->r, run->r->sky_factor);
    if (was_solved)
        restore_patterns(run);
    if (run->r->sun.is_there) {
        sun_report(run->r);
        sun_draw(&run->r->sun, &run->r->environment);
        light_by_environment(run->r);
    }
    if (status == STATUS_OK)
        status = run_stage(run, "refine", optimise, err);
    optimiser_free(run->optimiser);
    return status;
}

static enum status report(struct stage_run *run, struct error *err) {
    world_update_lights(&run->r->world);
    report_emitters(run->r);
    enum status status = report_held_out(run->r, &run->views, &run->pace, err);
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
