/* render_settings_check.c -- given settings of a render: each is checked by its type, then what they say of one another
 * (render_settings.h). */
#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/choices.h"
#include "common/mem.h"
#include "common/render_settings.h"
#include "common/setting_faults.h"
#include "common/setting_values.h"

#define TEXT_MAX_BYTES 4096 /* of a value */
#define FILE_MAX_BYTES 255  /* of a plain name */

static bool is_date(const char *text) {
    static const int days[] = {31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
    int year, month, day, used = 0;
    if (strlen(text) != 10 || sscanf(text, "%4d-%2d-%2d%n", &year, &month, &day, &used) != 3 || used != 10)
        return false;
    bool leap = (year % 4 == 0 && year % 100 != 0) || year % 400 == 0;
    return year >= 1900 && year <= 2100 && month >= 1 && month <= 12 && day >= 1 &&
           day <= days[month - 1] + (leap && month == 2);
}

static bool is_clock(const char *text) {
    unsigned hour, minute;
    int used = 0;
    return sscanf(text, "%2u:%2u%n", &hour, &minute, &used) == 2 && text[used] == '\0' && hour < 24 && minute < 60;
}

static bool in_range(const struct render_setting *t, const double *value, size_t count, struct setting_reason *why) {
    for (size_t i = 0; i < count; i++)
        if (!(value[i] >= t->minimum && value[i] <= t->maximum))
            return setting_refuse(why, "%.9g is not from %.9g to %.9g%s%s", value[i], t->minimum, t->maximum,
                                  *t->unit ? " " : "", t->unit);
    return true;
}

static bool check_number(const struct render_setting *t, const cJSON *value, struct setting_reason *why) {
    double number = cJSON_IsNumber(value) ? value->valuedouble : NAN;
    bool is_whole = t->type == RENDER_INT;
    if (!isfinite(number) || (is_whole && number != floor(number)))
        return setting_refuse(why, "must be a %snumber", is_whole ? "whole " : "");
    return in_range(t, &number, 1, why);
}

static bool check_numbers(const struct render_setting *t, const cJSON *value, struct setting_reason *why) {
    double number[RENDER_MAX_NUMBERS];
    if (setting_read_numbers(value, number, RENDER_MAX_NUMBERS) != t->count)
        return setting_refuse(why, "must be %zu numbers, as \"1, 2%s\"", t->count, t->count == 3 ? ", 3" : "");
    return in_range(t, number, t->count, why);
}

static bool check_factor(const struct render_setting *t, const cJSON *value, struct setting_reason *why) {
    double number[3];
    if (cJSON_IsString(value) && choices_index("on|off", value->valuestring, strlen(value->valuestring)) >= 0)
        return true;
    size_t count = setting_read_numbers(value, number, 3);
    if (count != 1 && count != 3)
        return setting_refuse(why, "must be on, off, a factor, or three of them for red, green and blue");
    return in_range(t, number, count, why);
}

static bool check_list(const struct render_setting *t, const char *text, struct setting_reason *why) {
    for (const char *at = text;;) {
        size_t length = strcspn(at, ",");
        if (choices_index(t->choices, at, length) < 0)
            return setting_refuse(why, "\"%.*s\" is not one of %s", (int)(length < 40 ? length : 40), at, t->choices);
        if (at[length] == '\0')
            return true;
        at += length + 1;
    }
}

static bool check_file(const struct render_setting *t, const char *text, enum render_files files,
                       struct setting_reason *why) {
    if (choices_index(t->choices, text, strlen(text)) >= 0 || files == RENDER_FILES_ANYWHERE)
        return true;
    if (strchr(text, '/') || text[0] == '.' || strlen(text) > FILE_MAX_BYTES)
        return setting_refuse(why, "must be the name of an attached file, without a folder");
    return true;
}

static bool check_text(const struct render_setting *t, const char *text, enum render_files files,
                       struct setting_reason *why) {
    double side[2];
    if (*text == '\0' && *t->default_text)
        return setting_refuse(why, "must not be empty");
    if (strlen(text) > TEXT_MAX_BYTES)
        return setting_refuse(why, "is longer than %d bytes", TEXT_MAX_BYTES);
    for (const char *at = text; *at; at++)
        if (iscntrl((unsigned char)*at))
            return setting_refuse(why, "has a control character");
    switch (t->type) {
    case RENDER_CHOICE:
        return choices_index(t->choices, text, strlen(text)) >= 0 ||
               setting_refuse(why, "must be one of %s", t->choices);
    case RENDER_LIST: return check_list(t, text, why);
    case RENDER_SIZE:
        return setting_read_size(text, side) ? in_range(t, side, 2, why)
                                             : setting_refuse(why, "must be of the form 640x480");
    case RENDER_DATE: return is_date(text) || setting_refuse(why, "must be a day of 1900 to 2100 as 2024-06-21");
    case RENDER_CLOCK: return is_clock(text) || setting_refuse(why, "must be a time from 00:00 to 23:59");
    case RENDER_FILE: return check_file(t, text, files, why);
    case RENDER_TEXT:
    case RENDER_INT:
    case RENDER_REAL:
    case RENDER_BOOL:
    case RENDER_NUMBERS:
    case RENDER_FACTOR: break;
    }
    return true;
}

static bool check_value(const struct render_setting *t, const cJSON *value, enum render_files files,
                        struct setting_reason *why) {
    switch (t->type) {
    case RENDER_INT:
    case RENDER_REAL: return check_number(t, value, why);
    case RENDER_NUMBERS: return check_numbers(t, value, why);
    case RENDER_FACTOR: return check_factor(t, value, why);
    case RENDER_BOOL: return cJSON_IsBool(value) || setting_refuse(why, "must be true or false");
    case RENDER_CHOICE:
    case RENDER_TEXT:
    case RENDER_LIST:
    case RENDER_SIZE:
    case RENDER_DATE:
    case RENDER_CLOCK:
    case RENDER_FILE: break;
    }
    if (!cJSON_IsString(value))
        return setting_refuse(why, "must be a string");
    return check_text(t, value->valuestring, files, why);
}

/* What settings say of one another is asked of those that are good by themselves; nothing is said of a setting where
 * one that it depends on is not good. */
struct settings_check {
    struct setting_faults faults;
    const cJSON *given, *good; /* good: those of `given` without a fault of their own */
};

static bool is_doubtful(const struct settings_check *c, const char *name) {
    return render_settings_has(c->given, name) && !render_settings_has(c->good, name);
}

/* A setting that another makes meaningless is a fault, not ignored. */
static void need(struct settings_check *c, const char *name, bool is_met, const char *reason) {
    if (render_settings_has(c->good, name) && !is_met)
        setting_faults_add(&c->faults, name, reason, "");
}

static void check_sky(struct settings_check *c) {
    static const char *const of_sky[] = {"date", "latitude", "longitude", "north",
                                         "suns", "time",     "turbidity", "utc_offset"};
    bool is_sky = render_settings_is(c->good, "environment", "sky");
    bool has_map = !is_sky && !render_settings_is(c->good, "environment", "none");
    if (is_doubtful(c, "environment"))
        return;
    for (size_t i = 0; i < sizeof of_sky / sizeof *of_sky; i++)
        need(c, of_sky[i], is_sky, "belongs to environment=sky");
    for (size_t i = 0; i < 3 && is_sky; i++)
        if (!render_settings_has(c->given, of_sky[i]))
            setting_faults_add(&c->faults, of_sky[i], "environment=sky needs it",
                               render_settings_find(of_sky[i], NULL)->help);
    need(c, "time", !is_sky || render_settings_number(c->good, "suns") == 1.0,
         "with suns the times are those from sunrise to sunset");
    need(c, "environment_turn", has_map, "only a map is turned; a sky has north");
    need(c, "environment_scale", has_map || is_sky, "there is no environment");
    need(c, "sky", has_map || is_sky, "there is no environment");
    need(c, "sun", is_sky || render_settings_is(c->good, "environment", "found"),
         "only a sky, or what was found, has a sun of its own");
}

static void check_cameras(struct settings_check *c) {
    bool has_path = render_settings_has(c->given, "path");
    need(c, "view", !has_path, "a path names its views itself");
    need(c, "path_count", has_path, "belongs to path");
    need(c, "multilayer",
         !render_settings_bool(c->good, "multilayer") || !render_settings_is(c->good, "format", "png") ||
             is_doubtful(c, "format"),
         "only EXR has layers: format=exr or both");
}

static void check_precision(struct settings_check *c) {
    bool has_exr = !render_settings_is(c->good, "format", "png") || render_settings_bool(c->good, "per_light") ||
                   is_doubtful(c, "format") || is_doubtful(c, "per_light");
    need(c, "precision", has_exr, "belongs to EXR: format=exr or both, or per_light");
    need(c, "precision",
         !render_settings_is(c->good, "precision", "half") || !render_settings_bool(c->good, "multilayer"),
         "layers of one file are float");
}

/* "lamp.3.radius": whether the settings of lamp 3 belong to its kind; the same of things that are inserted. */
static void check_lamp(struct settings_check *c, uint32_t number) {
    static const struct {
        const char *name, *kinds;
        bool is_needed;
    } of_kind[] = {{"position", "area|sphere|spot", true}, {"direction", "area|spot", true}, {"size", "area", false},
                   {"radius", "sphere|spot", false},       {"angle", "spot", false},         {"blend", "spot", false}};
    char name[SETTING_NAME_MAX], reason[128];
    snprintf(name, sizeof name, "lamp.%u.kind", number);
    if (!render_settings_has(c->given, name))
        setting_faults_add(&c->faults, name, "is missing", "area, sphere or spot");
    if (!render_settings_has(c->good, name))
        return;
    const char *kind = render_settings_text(c->good, name);
    for (size_t i = 0; i < sizeof of_kind / sizeof *of_kind; i++) {
        bool belongs = choices_index(of_kind[i].kinds, kind, strlen(kind)) >= 0;
        snprintf(name, sizeof name, "lamp.%u.%s", number, of_kind[i].name);
        snprintf(reason, sizeof reason, "kind=%s %s it", kind, belongs ? "needs" : "does not have");
        if (render_settings_has(c->given, name) ? !belongs && !is_doubtful(c, name) : belongs && of_kind[i].is_needed)
            setting_faults_add(&c->faults, name, reason, "");
    }
}

static bool is_thing_number(uint32_t number) { return number >= 1 && number <= RENDER_LAMPS_MAX; }

static void check_families(struct settings_check *c) {
    char name[SETTING_NAME_MAX];
    size_t count;
    uint32_t *number = render_settings_family(c->given, "lamp.", &count);
    for (size_t i = 0; i < count; i++)
        if (is_thing_number(number[i]))
            check_lamp(c, number[i]);
    mem_free(number);
    number = render_settings_family(c->given, "insert.", &count);
    for (size_t i = 0; i < count; i++) {
        snprintf(name, sizeof name, "insert.%u.file", number[i]);
        if (is_thing_number(number[i]) && !render_settings_has(c->given, name))
            setting_faults_add(&c->faults, name, "is missing", "a .glb, .gltf, .obj or .ply");
    }
    mem_free(number);
}

static void check_name(struct setting_faults *f, const cJSON *value, enum render_files files) {
    struct setting_reason why = {""};
    uint32_t number;
    const struct render_setting *t =
        strlen(value->string) <= SETTING_NAME_MAX ? render_settings_find(value->string, &number) : NULL;
    bool is_counted = t && (strncmp(t->name, "lamp.", 5) == 0 || strncmp(t->name, "insert.", 7) == 0);
    if (!t)
        setting_faults_add_unknown(f, value->string, render_settings_nearest(value->string));
    else if (is_counted && !is_thing_number(number))
        setting_faults_add(f, value->string, "is numbered from 1 to 1000", "");
    else if (!check_value(t, value, files, &why))
        setting_faults_add(f, value->string, why.text, t->help);
}

enum status render_settings_check(const cJSON *object, enum render_files files, cJSON *problems, struct error *err) {
    struct settings_check c = {.faults = {.problems = problems}, .given = object};
    if (!cJSON_IsObject(object)) {
        setting_faults_add(&c.faults, "settings", "must be an object of names and values", "");
        return error_set(err, STATUS_INPUT, "settings must be a JSON object");
    }
    cJSON *good = cJSON_CreateObject();
    for (const cJSON *value = object->child; value; value = value->next) {
        size_t before = c.faults.count;
        check_name(&c.faults, value, files);
        if (c.faults.count == before)
            json_add(good, value->string, cJSON_Duplicate(value, true));
    }
    c.good = good;
    check_sky(&c);
    check_cameras(&c);
    check_precision(&c);
    check_families(&c);
    cJSON_Delete(good);
    return setting_faults_status(&c.faults, err);
}

static enum setting_form form_of(const char *name) {
    const struct render_setting *t = render_settings_find(name, NULL);
    if (t && (t->type == RENDER_INT || t->type == RENDER_REAL))
        return SETTING_NUMBER;
    return t && t->type == RENDER_BOOL ? SETTING_TRUTH : SETTING_WORDS;
}

enum status render_settings_parse_assignment(const char *text, cJSON *object, struct error *err) {
    return setting_assign(text, object, form_of, err);
}
