/* test_json.c -- JSON text, as all of our inputs are read by; what was read is written and read
 * again, and is the same. */
#include "common/json.h"
#include "common/mem.h"
#include "common/utf8.h"
#include "tests/fuzz/fuzz.h"

static void write_and_read(const cJSON *value, char *(*write)(const cJSON *)) {
    cJSON *again = NULL;
    char *text = write(value);
    MUST(utf8_valid(text, strlen(text), NULL));
    MUST(json_parse(text, strlen(text), "our own text", &again, NULL) == STATUS_OK);
    char *second = write(again);
    MUST(strcmp(text, second) == 0);
    mem_free(second);
    mem_free(text);
    cJSON_Delete(again);
}

static void read_members(const cJSON *value) {
    double number;
    const char *text;
    bool flag;
    json_number(value, "a", "case", 1.0, &number, NULL);
    json_string(value, "a", "case", "", &text, NULL);
    json_bool(value, "a", "case", false, &flag, NULL);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    cJSON *value = NULL;
    struct error err = {.message = ""};
    enum status status = json_parse((const char *)data, size, "case", &value, &err);
    if (status == STATUS_OK) {
        write_and_read(value, json_text);
        write_and_read(value, json_page);
        read_members(value);
    } else {
        MUST((status == STATUS_INPUT || status == STATUS_LIMIT) && !value && err.message[0] != '\0');
    }
    cJSON_Delete(value);
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    s->mutants = 10000;
    seeds_text(s, "{\"a\": [1, -2.5e-3, true, null, \"\\u00e9\\ud83d\\ude00\\n\"], \"b\": {\"c\": 1e308}}");
    seeds_data(s, "vectors/json-suite", ".json");
}
