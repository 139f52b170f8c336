/* setting_faults.c -- see setting_faults.h. */
#include "common/setting_faults.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

bool setting_refuse(struct setting_reason *why, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(why->text, sizeof why->text, format, arguments);
    va_end(arguments);
    return false;
}

void setting_faults_add(struct setting_faults *f, const char *name, const char *reason, const char *hint) {
    if (f->count++ == 0)
        snprintf(f->first, sizeof f->first, "%.80s: %.160s", name, reason);
    if (!f->problems || f->count > SETTING_FAULTS_MAX)
        return;
    cJSON *problem = cJSON_CreateObject();
    json_add_string(problem, "name", name);
    json_add_string(problem, "reason", reason);
    if (*hint)
        json_add_string(problem, "hint", hint);
    cJSON_AddItemToArray(f->problems, problem);
}

void setting_faults_add_unknown(struct setting_faults *f, const char *name, const char *nearest) {
    char hint[128] = "";
    if (nearest)
        snprintf(hint, sizeof hint, "did you mean %s?", nearest);
    setting_faults_add(f, name, "there is no such setting", hint);
}

enum status setting_faults_status(const struct setting_faults *f, struct error *err) {
    if (f->count == 0)
        return STATUS_OK;
    return f->count == 1 ? error_set(err, STATUS_INPUT, "setting %s", f->first)
                         : error_set(err, STATUS_INPUT, "setting %s (and %zu more)", f->first, f->count - 1);
}

enum status setting_assign(const char *text, cJSON *object, enum setting_form (*form_of)(const char *name),
                           struct error *err) {
    const char *equals = strchr(text, '=');
    if (!equals || equals == text || equals - text > SETTING_NAME_MAX)
        return error_set(err, STATUS_INPUT, "\"%.100s\" is not of the form name=value", text);
    char name[SETTING_NAME_MAX + 1];
    snprintf(name, sizeof name, "%.*s", (int)(equals - text), text);
    if (cJSON_GetObjectItemCaseSensitive(object, name))
        return error_set(err, STATUS_INPUT, "setting %s is given twice", name);
    const char *value = equals + 1;
    enum setting_form form = form_of(name);
    char *end = NULL;
    double number = strtod(value, &end);
    if (form == SETTING_NUMBER && *value && !*end && isfinite(number))
        json_add_number(object, name, number);
    else if (form == SETTING_TRUTH && (!strcmp(value, "true") || !strcmp(value, "false")))
        json_add_bool(object, name, value[0] == 't');
    else
        json_add_string(object, name, value);
    return STATUS_OK;
}
