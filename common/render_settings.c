/* render_settings.c -- values of settings that were found good (render_settings.h). */
#include "common/render_settings.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "common/choices.h"
#include "common/mem.h"
#include "common/setting_values.h"

static const cJSON *find(const cJSON *object, const char *name) {
    return cJSON_GetObjectItemCaseSensitive(object, name);
}

static const char *default_of(const char *name) {
    const struct render_setting *t = render_settings_find(name, NULL);
    assert(t);
    return t->default_text;
}

bool render_settings_has(const cJSON *object, const char *name) { return find(object, name) != NULL; }

double render_settings_number(const cJSON *object, const char *name) {
    const cJSON *value = find(object, name);
    return cJSON_IsNumber(value) ? value->valuedouble : strtod(default_of(name), NULL);
}

bool render_settings_bool(const cJSON *object, const char *name) {
    const cJSON *value = find(object, name);
    return value ? cJSON_IsTrue(value) : strcmp(default_of(name), "true") == 0;
}

const char *render_settings_text(const cJSON *object, const char *name) {
    const cJSON *value = find(object, name);
    return cJSON_IsString(value) ? value->valuestring : default_of(name);
}

bool render_settings_is(const cJSON *object, const char *name, const char *word) {
    return strcmp(render_settings_text(object, name), word) == 0;
}

bool render_settings_lists(const cJSON *object, const char *name, const char *word) {
    size_t length = strlen(word);
    for (const char *at = render_settings_text(object, name); *at;) {
        size_t part = strcspn(at, ",");
        if (part == length && memcmp(at, word, length) == 0)
            return true;
        at += part + (at[part] == ',');
    }
    return false;
}

bool render_settings_numbers(const cJSON *object, const char *name, double value[RENDER_MAX_NUMBERS]) {
    const cJSON *given = find(object, name);
    return (given ? setting_read_numbers(given, value, RENDER_MAX_NUMBERS)
                  : setting_scan_numbers(default_of(name), value, RENDER_MAX_NUMBERS)) > 0;
}

void render_settings_factor(const cJSON *value, double factor[3]) {
    bool is_off = cJSON_IsString(value) && strcmp(value->valuestring, "off") == 0;
    factor[0] = factor[1] = factor[2] = is_off ? 0.0 : 1.0;
    size_t count = setting_read_numbers(value, factor, 3);
    for (size_t i = 1; i < 3 && count == 1; i++)
        factor[i] = factor[0];
}

bool render_settings_size(const cJSON *object, uint32_t *width, uint32_t *height) {
    double side[2];
    if (!setting_read_size(render_settings_text(object, "size"), side))
        return false;
    *width = (uint32_t)side[0];
    *height = (uint32_t)side[1];
    return true;
}

static int by_number(const void *a, const void *b) {
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return x < y ? -1 : x > y;
}

uint32_t *render_settings_family(const cJSON *object, const char *family, size_t *count) {
    uint32_t *found = NULL, number;
    *count = 0;
    for (const cJSON *value = object->child; value; value = value->next) {
        if (strncmp(value->string, family, strlen(family)) != 0 || !render_settings_find(value->string, &number))
            continue;
        found = mem_realloc_array(found, *count + 1, sizeof *found);
        found[(*count)++] = number;
    }
    if (*count > 1)
        qsort(found, *count, sizeof *found, by_number);
    size_t kept = 0;
    for (size_t i = 0; i < *count; i++)
        if (i == 0 || found[i] != found[i - 1])
            found[kept++] = found[i];
    *count = kept;
    return found;
}

cJSON *render_settings_files(const cJSON *object) {
    cJSON *files = cJSON_CreateArray();
    for (const cJSON *value = object->child; value; value = value->next) {
        const struct render_setting *t = render_settings_find(value->string, NULL);
        if (!t || t->type != RENDER_FILE || !cJSON_IsString(value) ||
            choices_index(t->choices, value->valuestring, strlen(value->valuestring)) >= 0)
            continue;
        bool is_there = false;
        for (const cJSON *other = files->child; other && !is_there; other = other->next)
            is_there = strcmp(other->valuestring, value->valuestring) == 0;
        if (!is_there)
            cJSON_AddItemToArray(files, json_new_string(value->valuestring));
    }
    return files;
}
