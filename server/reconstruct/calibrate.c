/* calibrate.c -- see calibrate.h. */
#include "server/reconstruct/calibrate.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "server/reconstruct/calibrate_light.h"

static void say_light(const struct reconstruction *r, const struct light_found *found,
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
             found->exposures_solved, found->drift ? ", told exposures drift" : "",
             found->white_balance ? ", white balance changes" : "", vignette, found->spread_after,
             found->spread_before);
    hooks->log(hooks->user, line);
}

static cJSON *gain_array(rgb gain) {
    return cJSON_CreateDoubleArray((double[]){(double)gain.r, (double)gain.g, (double)gain.b}, 3);
}

/* One entry for each training photograph that is not as it was claimed. */
static cJSON *photographs_found(const struct views *views) {
    cJSON *list = cJSON_CreateArray();
    for (size_t t = 0; t < views->train_count; t++) {
        const struct photograph *photo = &views->scene->photograph[views->train[t]];
        bool gained = photo->gain.r != 1.0f || photo->gain.g != 1.0f || photo->gain.b != 1.0f;
        if (photo->exposure_known && !gained)
            continue;
        cJSON *entry = cJSON_CreateObject();
        json_add_string(entry, "name", photo->name);
        json_add_number(entry, "exposure", (double)photo->exposure);
        json_add(entry, "gain", gain_array(photo->gain));
        cJSON_AddItemToArray(list, entry);
    }
    return list;
}

void calibrate(struct reconstruction *r, struct views *views, const struct reconstruct_hooks *hooks) {
    bool faults = settings_bool(r->settings, "calibrate");
    struct light_found light;
    calibrate_light(r->scene, views, &r->atlas, &r->inverse, faults, r->pool, &light);
    views_update_median(views);
    say_light(r, &light, hooks);
    cJSON *report = cJSON_AddObjectToObject(r->report, "calibration");
    json_add_int(report, "exposures_solved", (int64_t)light.exposures_solved);
    json_add_bool(report, "exposure_drift", light.drift);
    json_add_bool(report, "white_balance_drift", light.white_balance);
    if (light.vignette) {
        const float *v = r->scene->photograph[0].vignette;
        json_add(report, "vignette",
                 cJSON_CreateDoubleArray((double[]){(double)v[0], (double)v[1], (double)v[2]}, 3));
    }
    json_add_number(report, "spread_before", light.spread_before);
    json_add_number(report, "spread_after", light.spread_after);
    json_add(report, "photographs", photographs_found(views));
}
