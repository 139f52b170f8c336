/* test_settings.c -- the settings of a job, as JSON and as words of a command line; what was taken
 * lies in its range, and is taken again as it was. */
#include "common/mem.h"
#include "common/settings.h"
#include "tests/fuzz/fuzz.h"

static void check_ranges(const struct settings *s) {
    size_t count;
    const struct setting *table = settings_table(&count);
    for (size_t i = 0; i < count; i++)
        if (table[i].type == SETTING_INT || table[i].type == SETTING_REAL)
            MUST(s->number[i] >= table[i].minimum && s->number[i] <= table[i].maximum);
}

static void apply(const cJSON *object) {
    struct settings s, again;
    cJSON *problems = cJSON_CreateArray();
    settings_init(&s);
    settings_init(&again);
    enum status status = settings_apply(&s, object, problems, NULL);
    MUST((status == STATUS_OK) == (cJSON_GetArraySize(problems) == 0));
    check_ranges(&s);
    cJSON *full = settings_to_json(&s);
    MUST(settings_apply(&again, full, NULL, NULL) == STATUS_OK);
    cJSON *second = settings_to_json(&again);
    MUST(cJSON_Compare(full, second, true));
    cJSON_Delete(second);
    cJSON_Delete(full);
    cJSON_Delete(problems);
    settings_release(&again);
    settings_release(&s);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    cJSON *value = NULL, *object = cJSON_CreateObject();
    if (json_parse((const char *)data, size, "case", &value, NULL) == STATUS_OK)
        apply(value);
    char *text = fuzz_text(data, size);
    if (settings_parse_assignment(text, object, NULL) == STATUS_OK)
        apply(object);
    free(text);
    cJSON_Delete(object);
    cJSON_Delete(value);
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    struct settings defaults;
    char line[256];
    size_t count;
    const struct setting *table = settings_table(&count);
    s->mutants = 5000;
    settings_init(&defaults);
    cJSON *object = settings_to_json(&defaults);
    char *text = json_text(object);
    seeds_text(s, text);
    for (size_t i = 0; i < count; i++) {
        snprintf(line, sizeof line, "%s=%s", table[i].name, table[i].default_text);
        seeds_text(s, line);
    }
    mem_free(text);
    cJSON_Delete(object);
    settings_release(&defaults);
}
