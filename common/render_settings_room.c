/* render_settings_room.c -- whether good settings of a render fit the room that they are for: the segments and views
 * that they name are there, and it is known how bright its radiance is where they need it (render_settings.h). */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "common/render_settings.h"
#include "common/setting_faults.h"

/* The number that a word is, NAN where it is something else. */
static double number_of(const char *word) {
    char *end;
    double value = strtod(word, &end);
    return *word >= '0' && *word <= '9' && *end == '\0' ? value : NAN;
}

static bool is_named(const cJSON *item, const char *member, const char *name) {
    const char *its = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(item, member));
    return its && strcmp(its, name) == 0;
}

static bool has_segment(const cJSON *segments, double number) {
    for (const cJSON *s = segments->child; s; s = s->next)
        if (cJSON_GetNumberValue(cJSON_GetObjectItemCaseSensitive(s, "segment")) == number)
            return true;
    return false;
}

static bool has_name(const cJSON *list, const char *member, const char *name) {
    for (const cJSON *s = list->child; s; s = s->next)
        if (is_named(s, member, name))
            return true;
    return false;
}

/* Calls `is_there` for each word of a list with commas; the faults are those of the setting. */
static void check_words(struct setting_faults *f, const cJSON *object, const char *setting, const cJSON *list,
                        bool (*is_there)(const cJSON *list, const char *word), const char *what) {
    char reason[256];
    const char *at = render_settings_has(object, setting) ? render_settings_text(object, setting) : "";
    while (*at) {
        size_t length = strcspn(at, ",");
        char *word = mem_strndup(at, length);
        if (!is_there(list, word)) {
            snprintf(reason, sizeof reason, "the reconstruction has no %s \"%.80s\" among its %d", what, word,
                     cJSON_GetArraySize(list));
            setting_faults_add(f, setting, reason, "");
        }
        mem_free(word);
        at += length + (at[length] == ',');
    }
}

static bool is_segment(const cJSON *segments, const char *word) {
    return has_name(segments, "name", word) || has_segment(segments, number_of(word));
}

static bool is_view(const cJSON *frames, const char *word) {
    return number_of(word) < (double)cJSON_GetArraySize(frames) || has_name(frames, "file_path", word) ||
           strcmp(word, "all") == 0;
}

/* light.N and segment.N.* */
static void check_numbers(struct setting_faults *f, const cJSON *object, const cJSON *segments) {
    char reason[128];
    for (const cJSON *s = object->child; s; s = s->next) {
        uint32_t number;
        bool has_number = strncmp(s->string, "light.", 6) == 0 || strncmp(s->string, "segment.", 8) == 0;
        if (!has_number || !render_settings_find(s->string, &number) || has_segment(segments, number))
            continue;
        snprintf(reason, sizeof reason, "the room has segments 0 to %d", cJSON_GetArraySize(segments) - 1);
        setting_faults_add(f, s->string, reason, "");
    }
}

/* Whether it is light in lm or cd/m2 that the setting means. */
static bool is_absolute(const cJSON *setting) {
    size_t length = strlen(setting->string);
    bool is_lumen =
        length > 11 && strncmp(setting->string, "lamp.", 5) == 0 && strcmp(setting->string + length - 6, ".lumen") == 0;
    return is_lumen || (strcmp(setting->string, "unit") == 0 && cJSON_IsString(setting) &&
                        strcmp(setting->valuestring, "nits") == 0);
}

static void check_unit(struct setting_faults *f, const cJSON *object, const cJSON *report) {
    const cJSON *unit = cJSON_GetObjectItemCaseSensitive(report, "luminance_per_unit");
    if (render_settings_number(object, "luminance_per_unit") > 0.0 ||
        cJSON_GetNumberValue(cJSON_GetObjectItemCaseSensitive(unit, "cd_per_m2")) > 0.0)
        return;
    for (const cJSON *s = object->child; s; s = s->next)
        if (is_absolute(s))
            setting_faults_add(f, s->string, RENDER_UNIT_UNKNOWN, RENDER_UNIT_HINT);
}

enum status render_settings_check_room(const cJSON *object, const cJSON *report, const cJSON *frames, cJSON *problems,
                                       struct error *err) {
    struct setting_faults faults = {.problems = problems};
    const cJSON *segments = cJSON_GetObjectItemCaseSensitive(report, "segments");
    if (report)
        check_unit(&faults, object, report);
    if (cJSON_GetArraySize(segments) > 0) {
        check_numbers(&faults, object, segments);
        check_words(&faults, object, "remove", segments, is_segment, "segment");
    }
    if (cJSON_GetArraySize(frames) > 0) {
        check_words(&faults, object, "view", frames, is_view, "view");
        check_words(&faults, object, "path", frames, is_view, "view");
    }
    return setting_faults_status(&faults, err);
}

bool render_settings_need_report(const cJSON *object) {
    for (const cJSON *s = object->child; s; s = s->next)
        if (strncmp(s->string, "light.", 6) == 0 || strncmp(s->string, "segment.", 8) == 0 ||
            strcmp(s->string, "remove") == 0 || is_absolute(s))
            return true;
    return false;
}
