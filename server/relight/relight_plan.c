/* relight_plan.c -- see relight_plan.h. */
#include "server/relight/relight_plan.h"

#include "server/relight/cameras.h"
#include "server/relight/environment.h"
#include "server/relight/output.h"

#define GUESSED_SPP 1024 /* of a picture that is rendered until its noise is small */

bool relight_plan_needs_light(const cJSON *settings) {
    size_t count;
    const struct render_pass *pass = passes_table(&count);
    for (size_t i = 0; i < count; i++)
        if (pass[i].is_light && render_settings_lists(settings, "passes", pass[i].name))
            return true;
    return false;
}

enum status relight_plan_count(const struct relight_job *job, uint64_t *pictures, uint64_t *pixels, struct error *err) {
    struct cameras views;
    enum status status = cameras_read(job, (double[3]){0.0, 0.0, 0.0}, &views, err);
    if (status != STATUS_OK)
        return status;
    *pictures = (uint64_t)views.count * environment_suns(job);
    *pixels = 0;
    for (size_t i = 0; i < views.count; i++)
        *pixels += (uint64_t)views.view[i].camera.width * views.view[i].camera.height * environment_suns(job);
    cameras_release(&views);
    return STATUS_OK;
}

enum status relight_plan_make(const struct relight_job *job, struct relight_plan *plan, struct error *err) {
    const cJSON *s = job->settings;
    uint64_t pixels = 0;
    *plan = (struct relight_plan){0};
    bool is_until = render_settings_number(s, "noise") > 0.0 || render_settings_number(s, "time_limit") > 0.0;
    double spp = is_until && !render_settings_has(s, "spp") ? GUESSED_SPP : render_settings_number(s, "spp");
    enum status status = relight_plan_count(job, &plan->pictures, &pixels, err);
    if (status == STATUS_OK)
        output_digest(job, plan->digest);
    plan->paths = (double)pixels * (relight_plan_needs_light(s) ? spp : RELIGHT_FIRST_HIT_SPP);
    return status;
}
