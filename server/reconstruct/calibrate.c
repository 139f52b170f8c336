/* calibrate.c -- see calibrate.h. */
#include "server/reconstruct/calibrate.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/mem.h"
#include "server/capture/calibrate_blur.h"
#include "server/capture/calibrate_light.h"
#include "server/capture/poses/calibrate_poses.h"

static void log_light(const struct reconstruction *r, const struct light_found *found,
                      const struct reconstruct_hooks *hooks) {
    char line[256], vignette[80] = "";
    if (found->exposures_solved == 0 && !found->drift && !found->white_balance && !found->vignette)
        return;
    if (found->vignette) {
        const float *v = r->scene->photograph[0].vignette;
        snprintf(vignette, sizeof vignette, ", a vignette that leaves %.0f %% in the corners",
                 100.0 * exp((double)(v[0] + v[1] + v[2])));
    }
    snprintf(line, sizeof line,
             "calibration: %zu exposures solved%s%s%s; photographs of one place now differ by %.3f "
             "(rms of the logarithm), before by %.3f",
             found->exposures_solved, found->drift ? ", given exposures drift" : "",
             found->white_balance ? ", white balance changes" : "", vignette, found->spread_after,
             found->spread_before);
    hooks->log(hooks->user, line);
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

static void find_light(struct reconstruction *r, struct views *views, const struct photograph *claim,
                       struct light_found *found) {
    for (size_t i = 0; i < r->scene->photograph_count; i++) {
        struct photograph *photo = &r->scene->photograph[i];
        photo->exposure = claim[i].exposure;
        photo->gain = claim[i].gain;
        memcpy(photo->vignette, claim[i].vignette, sizeof photo->vignette);
    }
    calibrate_light(r->scene, views, &r->atlas, &r->inverse, settings_bool(r->settings, "calibrate"), r->pool, found);
    views_update_median(views);
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
    found->moved_count = found->held_out_moved_count = 0;
    found->shift_px = found->held_out_shift_px = 0.0;
}

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

static void report_light(const struct reconstruction *r, const struct light_found *found, cJSON *report) {
    const float *v = r->scene->photograph[0].vignette;
    const double vignette[3] = {(double)v[0], (double)v[1], (double)v[2]};
    json_add_int(report, "exposures_solved", (int64_t)found->exposures_solved);
    json_add_bool(report, "exposure_drift", found->drift);
    json_add_bool(report, "white_balance_drift", found->white_balance);
    json_add(report, "vignette", found->vignette ? cJSON_CreateDoubleArray(vignette, 3) : cJSON_CreateNull());
    json_add_number(report, "spread_before", found->spread_before);
    json_add_number(report, "spread_after", found->spread_after);
}

void calibrate(struct reconstruction *r, struct views *views, const struct reconstruct_hooks *hooks) {
    struct photograph *claim = save_claims(r->scene);
    struct light_found light;
    struct poses_found poses = {0};
    struct blur_found blur = {0};
    find_light(r, views, claim, &light);
    double spread_before = light.spread_before;
    if (settings_bool(r->settings, "calibrate")) {
        struct tracks tracks;
        tracks_make(&tracks, views, r->pool);
        find_poses(r, views, &tracks, claim, &light, &poses);
        calibrate_blur(r->scene, &tracks, &blur);
        tracks_release(&tracks);
    }
    light.spread_before = spread_before;
    r->exposures_drift = light.drift;
    r->colors_drift = light.white_balance;
    log_light(r, &light, hooks);
    log_poses(&poses, &blur, hooks);
    cJSON *report = cJSON_AddObjectToObject(r->report, "calibration");
    report_light(r, &light, report);
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
