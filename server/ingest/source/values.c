/* values.c -- see values.h. */
#include "server/ingest/source/values.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"

#define MAX_NUMBERS_BYTES ((size_t)1 << 16) /* of a small file of numbers */

/* --- plain text ------------------------------------------------------------------------------- */

bool numbers_parse(const char *text, size_t count, double *value) {
    for (size_t i = 0; i < count; i++) {
        char *end;
        if (!text)
            return false;
        value[i] = strtod(text, &end);
        if (end == text)
            return false;
        text = end + strspn(end, " \t\r\n,");
    }
    return *text == '\0';
}

enum status numbers_read(const struct listing *l, const char *path, size_t count, const char *what, double *value,
                         struct error *err) {
    char *text;
    enum status status = listing_text(l, path, MAX_NUMBERS_BYTES, &text, err);
    if (status == STATUS_OK && !numbers_parse(text, count, value))
        status = error_set(err, STATUS_INPUT, "%s: expected the %zu numbers of %s", path, count, what);
    mem_free(text);
    return status;
}

char *line_take(const char **text) {
    if (**text == '\0')
        return NULL;
    size_t length = strcspn(*text, "\n");
    char *line = mem_strndup(*text, length);
    *text += length + ((*text)[length] == '\n');
    if (length > 0 && line[length - 1] == '\r')
        line[length - 1] = '\0';
    return line;
}

/* --- JSON ------------------------------------------------------------------------------------- */

enum status json_file_read(const struct listing *l, const char *path, cJSON **tree, struct error *err) {
    struct mapping file;
    *tree = NULL;
    enum status status = listing_open(l, path, "a JSON file", &file, err);
    if (status == STATUS_OK && file.size > VALUES_JSON_MAX_BYTES)
        status = error_set(err, STATUS_LIMIT, "%s is larger than %zu bytes", path, VALUES_JSON_MAX_BYTES);
    if (status == STATUS_OK)
        status = json_parse(file.data, file.size, path, tree, err);
    mapping_close(&file);
    return status;
}

double json_value(const cJSON *item) {
    double value;
    if (cJSON_IsNumber(item))
        return item->valuedouble;
    return cJSON_IsString(item) && numbers_parse(item->valuestring, 1, &value) ? value : (double)NAN;
}

double json_member(const cJSON *object, const char *key) {
    return json_value(cJSON_GetObjectItemCaseSensitive(object, key));
}

bool json_numbers(const cJSON *array, size_t count, double *value) {
    const cJSON *item, *cell;
    size_t found = 0;
    if (!cJSON_IsArray(array))
        return false;
    cJSON_ArrayForEach(item, array) {
        bool is_row = cJSON_IsArray(item);
        for (cell = is_row ? item->child : item; cell; cell = is_row ? cell->next : NULL) {
            if (found == count || (!cJSON_IsNumber(cell) && !cJSON_IsString(cell)))
                return false;
            value[found++] = json_value(cell);
        }
    }
    return found == count;
}

static bool has_id(const cJSON *element, const char *key, const cJSON *id) {
    const cJSON *own = cJSON_GetObjectItemCaseSensitive(element, key);
    if (cJSON_IsString(own) && cJSON_IsString(id))
        return strcmp(own->valuestring, id->valuestring) == 0;
    return cJSON_IsNumber(own) && cJSON_IsNumber(id) && own->valuedouble == id->valuedouble;
}

const cJSON *json_find(const cJSON *array, const char *key, const cJSON *id, const cJSON **hint) {
    const cJSON *first = cJSON_IsArray(array) ? array->child : NULL, *start = *hint ? *hint : first;
    for (const cJSON *element = start; element; element = element->next)
        if (has_id(element, key, id))
            return *hint = element;
    for (const cJSON *element = first; element != start; element = element->next)
        if (has_id(element, key, id))
            return *hint = element;
    return NULL;
}

const char *json_text_member(const cJSON *object, const char *key) {
    return cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(object, key));
}
