/* scene_fit.c -- see scene_fit.h. The facts come from a worker that has parsed untrusted files: no member is taken for
 * granted. */
#include "server/job/scene_fit.h"

#include <string.h>

#include "common/mem.h"
#include "common/reading.h"
#include "server/store/store.h"

static const char *text_of(const cJSON *object, const char *key) {
    const char *text = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(object, key));
    return text ? text : "";
}

enum status scene_fit_check(const struct scene_row *scene, cJSON **remedy, struct error *err) {
    cJSON *facts = cJSON_Parse(scene->facts);
    const cJSON *fit = cJSON_GetObjectItemCaseSensitive(facts, "fit");
    const cJSON *known = cJSON_GetObjectItemCaseSensitive(fit, "remedy");
    /* The last one is that which decided. */
    const cJSON *evidence = cJSON_GetObjectItemCaseSensitive(fit, "evidence");
    const char *why = cJSON_GetStringValue(cJSON_GetArrayItem(evidence, cJSON_GetArraySize(evidence) - 1));
    const char *remedy_text = text_of(fit, "remedy_text");
    enum status status = STATUS_OK;
    if (remedy)
        *remedy = NULL;
    if (strcmp(text_of(fit, "verdict"), "no") == 0) {
        status = error_set(err, STATUS_CONFLICT, "the mesh and the photographs of scene %.12s do not fit%s%.600s",
                           scene->id, why ? ": " : "", why ? why : "");
        if (cJSON_IsObject(known)) {
            char *words = reading_words(known);
            error_hint(err, "%.110s%s`unbake scenes set %.12s %.90s`, then submit again", remedy_text,
                       *remedy_text ? ": " : "", scene->id, words);
            mem_free(words);
        } else {
            error_hint(err, "`unbake scenes show %.12s` has the evidence; the setting fit=ignore takes it as it is",
                       scene->id);
        }
        if (remedy && cJSON_IsObject(known))
            *remedy = cJSON_Duplicate(known, true);
    }
    cJSON_Delete(facts);
    return status;
}

cJSON *scene_fit_reading(const struct scene_row *scene) {
    cJSON *facts = cJSON_Parse(scene->facts);
    cJSON *reading = cJSON_DetachItemFromObjectCaseSensitive(facts, "reading");
    if (!cJSON_IsObject(reading)) {
        cJSON_Delete(reading);
        reading = cJSON_Parse(scene->reading);
    }
    cJSON_Delete(facts);
    return reading ? reading : cJSON_CreateObject();
}
