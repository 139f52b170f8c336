/* calibrate.c -- see calibrate.h. */
#include "server/reconstruct/calibrate.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/mem.h"
#include "server/capture/calibrate_blur.h"
#include "server/capture/calibrate_light.h"
#include "server/capture/poses/calibrate_poses.h"
#include "server/capture/poses/pose_registration.h"

/* Photographs that are moved by themselves beside a registration: more than half as many as without it, and so many,
 * say that it was not what was wrong. */
#define MANY_MOVED 12

static void log_light(const struct reconstruction *r, const struct light_found *found,
                      const struct reconstruct_hooks *hooks) {
    char line[320], vignette[80] = "";
    if (found->exposures_solved == 0 && !found->drift && !found->white_balance && !found->vignette && !found->tones)
        return;
    if (found->vignette) {
        const float *v = r->scene->photograph[0].vignette;
        snprintf(vignette, sizeof vignette, ", a vignette that leaves %.0f %% in the corners",
                 100.0 * exp((double)(v[0] + v[1] + v[2])));
    }
    snprintf(line, sizeof line,
             "calibration: %zu exposures solved%s%s%s%s; photographs of one place now differ by %.3f "
             "(rms of the logarithm), before by %.3f",
             found->exposures_solved, found->drift ? ", given exposures drift" : "",
             found->white_balance ? ", white balance changes" : "", vignette,
             found->tones ? ", a tone curve of the camera, taken off" : "", found->spread_after, found->spread_before);
    hooks->log(hooks->user, line);
    if (found->is_power_open && !found->tones)
        hooks->log(hooks->user,
                   "calibration: the exposures are not told, and without them a camera's contrast is not seen; "
                   "the photographs count as plain sRGB");
    if (found->tones && found->is_power_open)
        hooks->warning(
            hooks->user,
            "The camera changes contrast. Exposures are not told, so that only a part of it can be taken off, and base "
            "colours may be off. Photographs with EXIF, or an exposure for each frame of transforms.json, tell the rest.");
}

static cJSON *gain_array(rgb gain) {
    return cJSON_CreateDoubleArray((double[]){(double)gain.r, (double)gain.g, (double)gain.b}, 3);
}

/* One entry for each training photograph that was changed. `shift`: change of its pose, pixels, or NULL. */
static cJSON *photographs_found(const struct views *views, const float *shift) {
    cJSON *list = cJSON_CreateArray();
    for (size_t t = 0; t < views->train_count; t++) {
        const struct photograph *photo = &views->scene->photograph[views->train[t]];
        bool gained = photo->gain.r != 1.0f || photo->gain.g != 1.0f || photo->gain.b != 1.0f;
        float shift_px = shift ? shift[t] : 0.0f;
        if (photo->exposure_known && !gained && shift_px == 0.0f && photo->blur_px == 0.0f)
            continue;
        cJSON *entry = cJSON_CreateObject();
        json_add_string(entry, "name", photo->name);
        json_add_number(entry, "exposure", (double)photo->exposure);
        json_add(entry, "gain", gain_array(photo->gain));
        json_add_number(entry, "shift_px", (double)shift_px);
        json_add_number(entry, "blur_px", (double)photo->blur_px);
        cJSON_AddItemToArray(list, entry);
    }
    return list;
}

/* Copies of the photographs with exposure, gain, vignette and camera as given. */
static struct photograph *save_claims(const struct scene *scene) {
    struct photograph *claim = mem_array(scene->photograph_count + 1, sizeof *claim);
    memcpy(claim, scene->photograph, scene->photograph_count * sizeof *claim);
    return claim;
}

/* Light anew, from what the bundle claims. */
static void find_faults(struct reconstruction *r, struct views *views, const struct photograph *claim, int faults,
                        struct light_found *found) {
    for (size_t i = 0; i < r->scene->photograph_count; i++) {
        struct photograph *photo = &r->scene->photograph[i];
        photo->exposure = claim[i].exposure;
        photo->gain = claim[i].gain;
        memcpy(photo->vignette, claim[i].vignette, sizeof photo->vignette);
    }
    faults = settings_bool(r->settings, "calibrate") ? faults : 0;
    calibrate_light(r->scene, views, &r->atlas, &r->inverse, faults, r->pool, found);
    views_update_median(views);
}

/* Tones are straightened once, before anything else: pixels have no former state to return to. */
static void find_light(struct reconstruction *r, struct views *views, const struct photograph *claim,
                       struct light_found *found) {
    find_faults(r, views, claim, LIGHT_ALL & ~LIGHT_TONES, found);
}

static void update_edges(struct reconstruction *r, struct views *views, const struct poses_found *found) {
    for (uint32_t t = 0; t < views->train_count; t++) {
        if (found->shift[t] > 0.0f)
            views_update_edges(views, t, r->pool);
    }
}

/* Corrects poses and calibrates light again, which wrong correspondences had biased. Cross-validated: all cameras stay
 * unless photographs agree better at surface points that were not used for the poses. */
static void find_poses(struct reconstruction *r, struct views *views, const struct tracks *tracks,
                       const struct photograph *claim, struct light_found *light, struct poses_found *found) {
    double spread = light->spread_after;
    calibrate_poses(r->scene, tracks, r->pool, found);
    if (found->moved_count == 0)
        return;
    update_edges(r, views, found);
    find_light(r, views, claim, light);
    if (light->spread_after < spread)
        return;
    for (size_t i = 0; i < r->scene->photograph_count; i++)
        r->scene->photograph[i].camera = claim[i].camera;
    update_edges(r, views, found);
    find_light(r, views, claim, light);
    memset(found->shift, 0, views->train_count * sizeof *found->shift);
    found->is_drift = false;
    found->moved_count = found->held_out_moved_count = 0;
    found->shift_px = found->held_out_shift_px = 0.0;
}

/* --- registration ------------------------------------------------------------------------------- */

static void renew_tracks(struct reconstruction *r, struct views *views, struct tracks *tracks) {
    for (uint32_t t = 0; t < views->train_count; t++)
        views_update_edges(views, t, r->pool);
    tracks_release(tracks);
    tracks_make(tracks, views, r->pool);
}

/* Cameras as the bundle tells them, moved onto the mesh where they surely lie beside it; edges, tracks and, then, the
 * claims follow. `is_applied` of the registration: whether. Returns whether anything was moved, for good or not. */
static bool find_registration(struct reconstruction *r, struct views *views, struct tracks *tracks,
                              struct photograph *claim, struct pose_registration *registration) {
    struct pose_registration rest;
    for (size_t i = 0; i < r->scene->photograph_count; i++)
        r->scene->photograph[i].camera = claim[i].camera;
    if (!pose_registration_find(r->scene, tracks, false, r->pool, registration))
        return false;
    renew_tracks(r, views, tracks);
    if (pose_registration_find(r->scene, tracks, true, r->pool, &rest))
        pose_registration_add(registration, &rest);
    renew_tracks(r, views, tracks);
    registration->is_applied = pose_registration_agrees(registration, tracks, claim, r->pool);
    for (size_t i = 0; i < r->scene->photograph_count && registration->is_applied; i++)
        claim[i].camera = r->scene->photograph[i].camera;
    return true;
}

/* Unless poses drift, all photographs may lie beside the mesh together; then single poses are found anew from there.
 * That stays where it explains most of those that were moved before. */
static void register_all(struct reconstruction *r, struct views *views, struct tracks *tracks, struct photograph *claim,
                         struct light_found *light, struct poses_found *poses, struct pose_registration *registration) {
    const size_t bytes = r->scene->photograph_count * sizeof *claim;
    if (poses->is_drift)
        return;
    struct photograph *found = save_claims(r->scene), *told = mem_array(r->scene->photograph_count + 1, sizeof *told);
    struct poses_found single = *poses;
    struct light_found found_light = *light;
    memcpy(told, claim, bytes);
    bool is_changed = find_registration(r, views, tracks, claim, registration);
    if (registration->is_applied) {
        find_light(r, views, claim, light);
        find_poses(r, views, tracks, claim, light, poses);
        registration->is_applied = poses->moved_count < MANY_MOVED || 2 * poses->moved_count <= single.moved_count;
        poses_found_release(registration->is_applied ? &single : poses);
    }
    if (!registration->is_applied) {
        memcpy(r->scene->photograph, found, bytes);
        memcpy(claim, told, bytes);
        *poses = single;
        *light = found_light;
    }
    if (!registration->is_applied && is_changed) {
        views_update_median(views);
        renew_tracks(r, views, tracks);
    }
    mem_free(told);
    mem_free(found);
}

static double length3(const double v[3]) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

static void log_registration(const struct pose_registration *registration, const struct reconstruct_hooks *hooks) {
    char line[240];
    snprintf(
        line, sizeof line,
        "calibration: the photographs are turned by %.2f degrees against the mesh and lie %.1f mm beside it, %.2f px "
        "(rms); their poses follow the mesh",
        length3(registration->turn) * 180.0 / M_PI, 1000.0 * length3(registration->move), registration->shift_px);
    hooks->log(hooks->user, line);
}

/* JSON's null where none was looked for. */
static cJSON *report_registration(const struct pose_registration *registration) {
    double turn[3], turn_error[3];
    if (!(registration->deviations > 0.0))
        return cJSON_CreateNull();
    for (int k = 0; k < 3; k++) {
        turn[k] = registration->turn[k] * 180.0 / M_PI;
        turn_error[k] = registration->turn_error[k] * 180.0 / M_PI;
    }
    cJSON *report = cJSON_CreateObject();
    json_add_bool(report, "applied", registration->is_applied);
    json_add(report, "turn_degrees", cJSON_CreateDoubleArray(turn, 3));
    json_add(report, "turn_error_degrees", cJSON_CreateDoubleArray(turn_error, 3));
    json_add(report, "move_m", cJSON_CreateDoubleArray(registration->move, 3));
    json_add(report, "move_error_m", cJSON_CreateDoubleArray(registration->move_error, 3));
    json_add_number(report, "shift_px", registration->shift_px);
    json_add_number(report, "deviations", registration->deviations);
    json_add_number(report, "response", registration->response);
    return report;
}

/* --- report ------------------------------------------------------------------------------------- */

static void log_poses(const struct poses_found *poses, const struct blur_found *blur,
                      const struct reconstruct_hooks *hooks) {
    char line[240], held_out[80] = "";
    if (poses->held_out_moved_count > 0)
        snprintf(held_out, sizeof held_out, "; of %zu that are held out, by %.2f px", poses->held_out_moved_count,
                 poses->held_out_shift_px);
    if (poses->moved_count > 0) {
        snprintf(line, sizeof line, "calibration: the poses of %zu photographs were wrong, by %.2f px (rms)%s",
                 poses->moved_count, poses->shift_px, held_out);
        hooks->log(hooks->user, line);
    }
    if (blur->blurred_count > 0) {
        snprintf(line, sizeof line, "calibration: %zu photographs are blurred, by %.1f px; they count less",
                 blur->blurred_count, blur->blur_px);
        hooks->log(hooks->user, line);
    }
}

/* What some linear values of the files come to once the camera's curve is taken off, over what 1 comes to. */
static cJSON *report_tones(const struct tone_curve *curve) {
    static const double stored[] = {0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0};
    enum { COUNT = sizeof stored / sizeof *stored };
    double straight[COUNT];
    struct tone_table *table = mem_array(1, sizeof *table);
    tone_table_init(table);
    tone_table_set(table, curve);
    for (size_t i = 0; i < COUNT; i++)
        straight[i] = exp(tone_straight(table, log(stored[i])) - tone_straight(table, 0.0));
    mem_free(table);
    cJSON *report = cJSON_CreateObject();
    json_add(report, "stored", cJSON_CreateDoubleArray(stored, COUNT));
    json_add(report, "straight", cJSON_CreateDoubleArray(straight, COUNT));
    return report;
}

static void report_light(const struct reconstruction *r, const struct light_found *found, cJSON *report) {
    const float *v = r->scene->photograph[0].vignette;
    const double vignette[3] = {(double)v[0], (double)v[1], (double)v[2]};
    json_add_int(report, "exposures_solved", (int64_t)found->exposures_solved);
    json_add_bool(report, "exposure_drift", found->drift);
    json_add_bool(report, "white_balance_drift", found->white_balance);
    json_add(report, "vignette", found->vignette ? cJSON_CreateDoubleArray(vignette, 3) : cJSON_CreateNull());
    json_add(report, "tone_curve", found->tones ? report_tones(&found->curve) : cJSON_CreateNull());
    json_add_bool(report, "contrast_unknown", found->is_power_open);
    json_add_number(report, "spread_before", found->spread_before);
    json_add_number(report, "spread_after", found->spread_after);
}

void calibrate(struct reconstruction *r, struct views *views, const struct reconstruct_hooks *hooks) {
    struct light_found light, first;
    struct poses_found poses = {0};
    struct blur_found blur = {0};
    struct pose_registration registration = {0};
    struct photograph *claim = save_claims(r->scene);
    find_faults(r, views, claim, LIGHT_ALL, &first);
    light = first;
    if (settings_bool(r->settings, "calibrate")) {
        struct tracks tracks;
        tracks_make(&tracks, views, r->pool);
        find_poses(r, views, &tracks, claim, &light, &poses);
        register_all(r, views, &tracks, claim, &light, &poses, &registration);
        calibrate_blur(r->scene, &tracks, &blur);
        tracks_release(&tracks);
    }
    light.spread_before = first.spread_before;
    light.tones = first.tones;
    light.curve = first.curve;
    light.is_power_open = first.is_power_open;
    r->exposures_drift = light.drift;
    r->colors_drift = light.white_balance;
    log_light(r, &light, hooks);
    if (registration.is_applied)
        log_registration(&registration, hooks);
    log_poses(&poses, &blur, hooks);
    cJSON *report = cJSON_AddObjectToObject(r->report, "calibration");
    report_light(r, &light, report);
    json_add(report, "registration", report_registration(&registration));
    json_add_int(report, "poses_moved", (int64_t)poses.moved_count);
    json_add_number(report, "pose_shift_px", poses.shift_px);
    json_add_int(report, "held_out_poses_moved", (int64_t)poses.held_out_moved_count);
    json_add_number(report, "held_out_pose_shift_px", poses.held_out_shift_px);
    json_add_int(report, "blurred", (int64_t)blur.blurred_count);
    json_add_number(report, "blur_px", blur.blur_px);
    json_add(report, "photographs", photographs_found(views, poses.shift));
    poses_found_release(&poses);
    mem_free(claim);
}
