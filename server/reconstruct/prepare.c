/* prepare.c -- see prepare.h. */
#include "server/reconstruct/prepare.h"

#include <stdio.h>

#include "common/mem.h"
#include "server/capture/clip.h"
#include "server/capture/distant/environment_gather.h"
#include "server/capture/fireflies.h"
#include "server/capture/orient.h"
#include "server/capture/radiance_preview.h"
#include "server/capture/seen_share.h"
#include "server/capture/texel_density.h"
#include "server/holes/holes.h"
#include "server/light/decision/split.h"
#include "server/light/sun/sun_seen.h"
#include "server/reconstruct/calibrate.h"
#include "server/scene/mesh_denoise.h"
#include "server/scene/normals.h"

/* Initial material, with NEUTRAL_BASE_COLOR: the middle of each range. */
#define NEUTRAL_ROUGHNESS 0.5f
#define NEUTRAL_SPECULAR 0.5f

/* White paint over the room's median radiance: .85 and .4 (server/light/light_priors.h). */
#define SKY_OVER_ROOM 2.1f

#define MIN_TRAINING 16 /* training photographs that must remain for any to be held out */

/* Parts of the time of prepare, measured on staircase2 at 2048 x 2048: atlas; visibility; calibration. The rest is the
 * second atlas. */
#define MAP_SHARE 0.08
#define VIEWS_SHARE 0.06
#define CALIBRATE_SHARE 0.72

struct prepare {
    struct reconstruction *r;
    struct views *views;
    const struct pace *pace;
    size_t flipped;      /* flipped triangles */
    const char *normals; /* their source: given, estimated, none */
    float roughness;     /* of a mesh whose normals are estimated */
    bool has_filled;     /* holes of the scan */
};

void prepare_environment(struct reconstruction *r) {
    if (r->environment.map.pixel)
        world_set_environment(&r->world, &r->environment.map, r->pool);
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

static void report_capture(const struct prepare *p) {
    const struct mesh_report *mesh = &p->r->scene->mesh_report;
    cJSON *figures = cJSON_AddObjectToObject(p->r->report, "prepare");
    json_add_int(figures, "degenerate_triangles_dropped", (int64_t)mesh->degenerate_count);
    json_add_int(figures, "duplicate_triangles_dropped", (int64_t)mesh->duplicate_count);
    json_add_int(figures, "triangles_turned", (int64_t)p->flipped);
    json_add_string(figures, "normals", p->normals);
    json_add_number(figures, "mesh_noise_m", (double)p->r->mesh_noise_m);
    json_add_number(figures, "mesh_roughness", (double)p->roughness);
    json_add_int(figures, "training_photographs", (int64_t)p->views->train_count);
    json_add_number(figures, "median_radiance", (double)p->views->median_radiance);
}

void prepare_report_surface(const struct reconstruction *r) {
    cJSON *figures = cJSON_GetObjectItemCaseSensitive(r->report, "prepare");
    json_add_int(figures, "triangles", (int64_t)r->scene->mesh.triangle_count);
    json_add_int(figures, "segments", (int64_t)r->segments.count);
    json_add_int(figures, "charts", (int64_t)r->atlas.chart_count);
    json_add_int(figures, "texture_width", r->atlas.width);
    json_add_int(figures, "texture_height", r->atlas.height);
    json_add_number(figures, "texels_per_metre", (double)r->atlas.texels_per_metre);
    json_add_int(figures, "valid_texels", (int64_t)r->inverse.valid_count);
    json_add_number(figures, "atlas_utilisation",
                    (double)r->inverse.valid_count / ((double)r->atlas.width * (double)r->atlas.height));
    json_add_int(figures, "atlas_padding", r->atlas.padding);
    json_add_int(figures, "atlas_clean_mip_level", atlas_clean_level(r->atlas.padding));
}

/* Makes everything that depends on the segments. density[triangle_count]: texture density (atlas_make_uneven), or
 * NULL. */
static enum status map_surface(struct reconstruction *r, const float *density, struct error *err) {
    const struct mesh *mesh = &r->scene->mesh;
    uint32_t size = (uint32_t)settings_number(r->settings, "texture_size");
    float texels_per_metre = (float)settings_number(r->settings, "texels_per_metre");
    uint32_t padding = (uint32_t)settings_number(r->settings, "padding");
    enum status status = density ? atlas_make_uneven(&r->atlas, mesh, &r->segments, size, density, padding, err)
                                 : atlas_make(&r->atlas, mesh, &r->segments, size, texels_per_metre, padding, err);
    if (status != STATUS_OK)
        return status;
    inverse_uv_make(&r->inverse, &r->atlas, mesh->triangle_count, r->pool);
    materials_init(&r->materials, &r->inverse, r->segments.count, rgb_gray(NEUTRAL_BASE_COLOR), NEUTRAL_ROUGHNESS,
                   NEUTRAL_SPECULAR);
    materials_start_deviation(&r->materials);
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

static void report_split(const struct prepare *p, const struct split *split) {
    cJSON *list = cJSON_AddArrayToObject(p->r->report, "parts_that_shine");
    for (size_t i = 0; i < split->part_count; i++) {
        cJSON *entry = cJSON_CreateObject();
        json_add_int(entry, "segment", (int64_t)(split->old_count + i));
        json_add_int(entry, "of_segment", (int64_t)split->whole[i]);
        const char *name = segments_name(&p->r->segments, &p->r->scene->mesh, split->whole[i]);
        if (name)
            json_add_string(entry, "name", name);
        cJSON_AddItemToArray(list, entry);
    }
    char line[128];
    snprintf(line, sizeof line, "segments: %zu parts that shine were split off, as segments of their own",
             split->part_count);
    if (split->part_count > 0)
        p->pace->hooks->log(p->pace->hooks->user, line);
}

/* Splits bright parts off their segments; true when there were any. */
static bool split_bright_parts(struct prepare *p) {
    struct split split;
    split_segments(&split, p->r, p->views);
    report_split(p, &split);
    bool any = split.part_count > 0;
    split_release(&split);
    return any;
}

/* The same again, after mesh or segments changed. */
static enum status remake_surface(struct prepare *p, const float *density, struct error *err) {
    struct reconstruction *r = p->r;
    release_surface(r);
    mem_free(r->radiance_preview); /* of the former atlas */
    r->radiance_preview = NULL;
    enum status status = map_surface(r, density, err);
    if (status != STATUS_OK)
        return status;
    views_update_segments(p->views, r->world.accel, r->pool);
    prepare_environment(r);
    return STATUS_OK;
}

/* Makes the atlas again, with the split segments and a density by visibility; so many triangles at the end of the mesh
 * are coarse, be they seen. */
static enum status remap_surface(struct prepare *p, bool has_split, size_t coarse, struct error *err) {
    struct reconstruction *r = p->r;
    bool even = settings_number(r->settings, "texels_per_metre") > 0.0;
    if (even && !has_split)
        return STATUS_OK;
    float *density = even ? NULL : mem_array(r->scene->mesh.triangle_count, sizeof *density);
    if (density)
        texel_density_from_views(p->views, &r->atlas, r->pool, density);
    size_t count = r->scene->mesh.triangle_count;
    for (size_t t = count - coarse; t < count && density; t++)
        density[t] = TEXEL_DENSITY_UNSEEN;
    enum status status = remake_surface(p, density, err);
    mem_free(density);
    return status;
}

static void denoise_mesh(struct prepare *p) {
    char line[128];
    if (settings_bool(p->r->settings, "denoise_mesh"))
        p->r->mesh_noise_m = mesh_denoise(&p->r->scene->mesh, p->r->pool);
    if (p->r->mesh_noise_m == 0.0f)
        return;
    snprintf(line, sizeof line, "mesh: its vertices are off by %.2g mm; they were put back",
             1e3 * (double)p->r->mesh_noise_m);
    p->pace->hooks->log(p->pace->hooks->user, line);
}

static void estimate_normals(struct prepare *p) {
    struct mesh *mesh = &p->r->scene->mesh;
    bool had_some = mesh->normal != NULL;
    if (normals_estimate(mesh, p->r->pool, &p->roughness) && !had_some)
        p->pace->hooks->log(p->pace->hooks->user, "mesh: it has no normals; they are estimated");
    p->normals = had_some ? "given" : mesh->normal ? "estimated" : "none";
}

/* A first preview, before the slow steps. */
static enum status show_radiance(struct prepare *p, struct error *err) {
    struct reconstruction *r = p->r;
    const struct reconstruct_hooks *hooks = p->pace->hooks;
    if (!hooks->preview_due(hooks->user))
        return STATUS_OK;
    r->radiance_preview = radiance_preview(p->views, &r->atlas, &r->inverse, r->pool);
    return hooks->preview(hooks->user, r, err);
}

/* Reports a part of prepare as done. */
static void advance(struct prepare *p, double share) { pace_advance(p->pace, "prepare", PLAN_PREPARE, share); }

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

/* The point of known reflectance, if the settings name one. */
static enum status find_grey_card(struct reconstruction *r, struct error *err) {
    struct pixel_setting pixel;
    if (!settings_pixel(r->settings, "grey_card", &pixel))
        return STATUS_OK;
    const struct surface surface = reconstruction_surface(r);
    return grey_card_find(&r->grey_card, &pixel, r->scene, &surface, r->world.accel, err);
}

/* Ends a job that could measure next to nothing before it takes minutes. */
static enum status require_seen_surface(struct prepare *p, struct error *err) {
    struct seen_share share = seen_share_measure(p->views, p->r->pool);
    json_add_number(p->r->report, "seen_surface_share", share.surface);
    return seen_share_require(&share, settings_is(p->r->settings, "fit", "ignore"), err);
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

/* Rights the mesh, and maps it to texels. */
static enum status make_surface(struct prepare *p, struct error *err) {
    struct reconstruction *r = p->r;
    enum status status = orient_mesh(r->scene, r->pool, &p->flipped, err);
    if (status != STATUS_OK)
        return status;
    denoise_mesh(p);
    estimate_normals(p);
    make_segments(r);
    status = map_surface(r, NULL, err);
    if (status == STATUS_OK)
        advance(p, MAP_SHARE);
    return status;
}

static void report_holes(const struct prepare *p, struct holes_found *found) {
    cJSON *report = cJSON_AddObjectToObject(p->r->report, "holes");
    char line[200];
    json_add_int(report, "filled", (int64_t)found->filled);
    json_add_number(report, "filled_m2", found->filled_m2);
    json_add_int(report, "triangles", (int64_t)found->triangles);
    json_add_int(report, "openings_kept", (int64_t)found->kept);
    json_add_number(report, "openings_m2", found->kept_m2);
    json_add(report, "regions", found->list ? found->list : cJSON_CreateArray());
    snprintf(line, sizeof line, "mesh: %zu holes were filled, %.3g m2; %zu openings are kept, %.3g m2", found->filled,
             found->filled_m2, found->kept, found->kept_m2);
    if (found->filled > 0)
        p->pace->hooks->log(p->pace->hooks->user, line);
}

/* Fills holes of the mesh, but none that crop cut, and makes again what was made of it. */
static enum status fill_holes(struct prepare *p, struct error *err) {
    struct reconstruction *r = p->r;
    struct holes_found found;
    double lower[3], upper[3];
    vec3 box[2];
    if (settings_is(r->settings, "holes", "keep"))
        return STATUS_OK;
    bool is_cropped = settings_box(r->settings, "crop", lower, upper);
    for (int k = 0; k < 2 && is_cropped; k++) { /* in the coordinates of the input (mesh.h) */
        const double *c = k == 0 ? lower : upper, *offset = r->scene->mesh.offset;
        box[k] = vec3_make((float)(c[0] - offset[0]), (float)(c[1] - offset[1]), (float)(c[2] - offset[2]));
    }
    struct holes_wanted wanted = {.fills_all = settings_is(r->settings, "holes", "fill"),
                                  .fills_hidden = !r->scene->mesh.object_id, /* what is modelled is meant */
                                  .within = is_cropped ? box : NULL};
    holes_fill(r->scene, &r->segments, p->views, &wanted, r->pool, &found);
    report_holes(p, &found);
    p->has_filled = found.triangles > 0;
    return found.triangles > 0 ? remake_surface(p, NULL, err) : STATUS_OK;
}

/* Whether what photographs show through the mesh may be a sky that lights the room: most of it is brighter than white
 * paint would be there. Parts may be: lamps. */
static bool shows_sky(const struct prepare *p) {
    const struct environment *e = &p->r->environment;
    float white = SKY_OVER_ROOM * p->views->median_radiance;
    double seen = 0.0, bright = 0.0;
    for (size_t i = 0; e->map.pixel && i < environment_pixel_count(e); i++) {
        double angle = environment_pixel_is_seen(e, i) ? environment_cell_angle(e, i / e->map.width) : 0.0;
        seen += angle;
        bright += rgb_mean(environment_pixel_radiance(e, i)) > white ? angle : 0.0;
    }
    return bright > 0.5 * seen;
}

/* Calibrates the photographs, fills the holes that they show, and finds what of them is to be trusted and the distant
 * light they show. */
static enum status measure_photographs(struct prepare *p, struct error *err) {
    struct reconstruction *r = p->r;
    calibrate(r, p->views, p->pace->hooks);
    enum status status = fill_holes(p, err);
    if (status != STATUS_OK)
        return status;
    noise_measure(&r->noise, p->views, r->pool);
    noise_set_black(&r->noise, r->scene);
    clip_mark(r->scene, p->views, &r->noise, r->pool);
    fireflies_mark(r->scene, p->views, &r->noise, r->pool);
    environment_gather(&r->environment, p->views, reconstruction_edge_m(r), r->pool);
    r->is_surrounded = p->has_filled && !shows_sky(p);
    sun_seen_take(&r->environment, &r->sun);
    prepare_environment(r);
    advance(p, CALIBRATE_SHARE);
    return STATUS_OK;
}

static enum status refuse_segmentation(struct error *err) {
    error_set(err, STATUS_INPUT,
              "segmentation=given, but the mesh tells no objects apart: its faces have no object_id");
    return error_hint(err, "leave the setting out: segments are then made from the mesh's shape");
}

enum status prepare_run(struct reconstruction *r, struct views *views, const struct pace *pace, struct error *err) {
    struct prepare prepare = {.r = r, .views = views, .pace = pace}, *p = &prepare;
    if (settings_is(r->settings, "segmentation", "given") && !r->scene->mesh.object_id)
        return refuse_segmentation(err);
    hold_out(r);
    enum status status = reserve_pixels(r, err);
    if (status == STATUS_OK)
        status = make_surface(p, err);
    if (status != STATUS_OK)
        return status;
    views_init(p->views, r->scene, &r->segments, r->world.accel, r->pool);
    advance(p, VIEWS_SHARE);
    status = require_seen_surface(p, err);
    if (status == STATUS_OK)
        status = show_radiance(p, err);
    if (status != STATUS_OK)
        return status;
    status = measure_photographs(p, err);
    if (status == STATUS_OK)
        status = remap_surface(p, split_bright_parts(p), 0, err);
    report_capture(p);
    pace_measure_room(p->pace, r->scene, &r->inverse);
    advance(p, 1.0 - MAP_SHARE - VIEWS_SHARE - CALIBRATE_SHARE);
    if (status == STATUS_OK)
        status = check_segment_settings(r, err);
    return status == STATUS_OK ? find_grey_card(r, err) : status;
}

enum status prepare_again(struct reconstruction *r, struct views *views, size_t coarse, struct error *err) {
    struct prepare prepare = {.r = r, .views = views};
    enum status status = remake_surface(&prepare, NULL, err);
    if (status == STATUS_OK)
        status = remap_surface(&prepare, false, coarse, err);
    return status == STATUS_OK ? find_grey_card(r, err) : status;
}
