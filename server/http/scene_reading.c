/* scene_reading.c -- see scene_reading.h. */
#include "server/http/scene_reading.h"

#include <string.h>

#include "common/mem.h"
#include "common/reading.h"
#include "server/transport/problem.h"

/* Each member by itself, so that each fault is told. */
static void find_faults(const cJSON *value, cJSON *params) {
    const cJSON *member;
    cJSON_ArrayForEach(member, value) {
        struct reading reading;
        struct error err;
        cJSON *alone = cJSON_CreateObject();
        json_add(alone, member->string, cJSON_Duplicate(member, true));
        if (reading_parse(alone, &reading, &err) != STATUS_OK) {
            char *name = mem_printf("reading.%.80s", member->string);
            problem_param(params, name, NULL, "%s", err.message);
            mem_free(name);
        }
        reading_release(&reading);
        cJSON_Delete(alone);
    }
}

static char *text_of(const cJSON *value, struct error *err) {
    struct reading reading;
    char *text = NULL;
    if (reading_parse(cJSON_IsNull(value) ? NULL : value, &reading, err) == STATUS_OK) {
        cJSON *json = reading_json(&reading);
        text = json_text(json);
        cJSON_Delete(json);
    }
    reading_release(&reading);
    return text;
}

char *scene_reading_text(const cJSON *value, cJSON *params) {
    struct error err;
    char *text = text_of(value, &err);
    if (!text && cJSON_IsObject(value))
        find_faults(value, params);
    else if (!text)
        problem_param(params, "reading", NULL, "%s", err.message);
    return text;
}

char *scene_reading_parse(const char *text, size_t length, const char *what, struct error *err) {
    cJSON *value;
    if (json_parse(text, length, what, &value, err) != STATUS_OK)
        return NULL;
    char *found = text_of(value, err);
    cJSON_Delete(value);
    return found;
}

char *scene_reading_query(const struct request *r, struct response **refusal) {
    const char *given = target_query(&r->target, "reading");
    struct error err;
    cJSON *value, *params;
    if (!given)
        return NULL;
    params = cJSON_CreateArray();
    char *text = NULL;
    if (json_parse(given, strlen(given), "the reading", &value, &err) != STATUS_OK)
        problem_param(params, "reading", NULL, "%s", err.message);
    else
        text = scene_reading_text(value, params);
    cJSON_Delete(value);
    if (text)
        cJSON_Delete(params);
    else
        *refusal = problem_invalid(r, "the reading is invalid", params);
    return text;
}
