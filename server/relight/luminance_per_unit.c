/* luminance_per_unit.c -- see luminance_per_unit.h. */
#include "server/relight/luminance_per_unit.h"

#include <stdio.h>
#include <string.h>

#include "server/relight/setting_files.h"

#define NAME "luminance_per_unit"

/* What report.json says, or 0; *within is the factor by which it may be wrong, 0 where that is not said. */
static double reported(const struct relight_job *job, double *within) {
    cJSON *report = setting_files_report(job);
    const cJSON *unit = cJSON_GetObjectItemCaseSensitive(report, NAME);
    const cJSON *value = cJSON_GetObjectItemCaseSensitive(unit, "cd_per_m2");
    const cJSON *factor = cJSON_GetObjectItemCaseSensitive(unit, "within_factor");
    const char *source = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(unit, "source"));
    double found = cJSON_IsNumber(value) && value->valuedouble > 0.0 ? value->valuedouble : 0.0;
    *within = source && strcmp(source, "camera settings") == 0 && cJSON_IsNumber(factor) ? factor->valuedouble : 0.0;
    cJSON_Delete(report);
    return found;
}

/* Of what needs the unit, the first; NULL: nothing does. */
static const char *needs_it(const cJSON *settings) {
    for (const cJSON *s = settings->child; s; s = s->next) {
        size_t length = strlen(s->string);
        if (length > 6 && strncmp(s->string, "lamp.", 5) == 0 && strcmp(s->string + length - 6, ".lumen") == 0)
            return s->string;
    }
    return render_settings_is(settings, "unit", "nits") ? "unit" : NULL;
}

static void say(const struct relight_watch *watch, double unit, double within) {
    char by[64] = "report", text[160];
    if (within > 0.0)
        snprintf(by, sizeof by, "photographs' camera settings, within a factor of %.2g", within);
    snprintf(text, sizeof text, "radiance 1 is %.3g cd/m2 by the reconstruction's %s", unit, by);
    if (watch->message)
        watch->message(watch->user, text);
}

enum status luminance_per_unit_resolve(const struct relight_job *job, const struct relight_watch *watch,
                                       cJSON **settings, struct error *err) {
    double within = 0.0;
    *settings = cJSON_Duplicate(job->settings, true);
    if (render_settings_number(job->settings, NAME) > 0.0)
        return STATUS_OK;
    double found = reported(job, &within);
    const char *name = needs_it(job->settings);
    if (found > 0.0) {
        cJSON_DeleteItemFromObjectCaseSensitive(*settings, NAME);
        json_add_number(*settings, NAME, found);
        say(watch, found, within);
    }
    if (!name || found > 0.0)
        return STATUS_OK;
    enum status status = error_set(err, STATUS_INPUT, "setting %s: " RENDER_UNIT_UNKNOWN, name);
    error_hint(err, RENDER_UNIT_HINT);
    return status;
}
