/* matrix.c -- see matrix.h. */
#include "client/matrix.h"

#include <string.h>

#include "common/mem.h"
#include "common/settings.h"

/* Adds the value that text[length] names. */
static enum status add_value(struct matrix_axis *axis, const char *text, size_t length, struct error *err) {
    cJSON *parsed = cJSON_CreateObject();
    char *assignment = mem_printf("%s=%.*s", axis->key, (int)length, text);
    enum status status = settings_parse_assignment(assignment, parsed, err);
    if (status == STATUS_OK) {
        cJSON_AddItemToArray(axis->values, cJSON_Duplicate(parsed->child, true));
        axis->word = mem_realloc_array(axis->word, axis->count + 1, sizeof *axis->word);
        axis->word[axis->count++] = mem_strndup(text, length);
    }
    mem_free(assignment);
    cJSON_Delete(parsed);
    return status;
}

/* "key=a,b,c". Where a value has commas itself, they are parted by semicolons. */
static enum status read_axis(struct matrix_axis *axis, const char *text, struct error *err) {
    const char *equals = strchr(text, '=');
    if (!equals || equals == text || !equals[1])
        return error_set(err, STATUS_INPUT, "--matrix \"%.100s\" is not of the form key=value,value", text);
    axis->key = mem_strndup(text, (size_t)(equals - text));
    axis->values = cJSON_CreateArray();
    const char *at = equals + 1, *separator = strchr(at, ';') ? ";" : ",";
    enum status status = STATUS_OK;
    for (bool is_last = false; !is_last && status == STATUS_OK;) {
        size_t length = strcspn(at, separator);
        status = length ? add_value(axis, at, length, err)
                        : error_set(err, STATUS_INPUT, "--matrix \"%.100s\" has an empty value", text);
        is_last = !at[length];
        at += length + !is_last;
    }
    return status;
}

static enum status check_key(const struct matrix *m, const char *key, const cJSON *settings, struct error *err) {
    for (size_t i = 0; i + 1 < m->axis_count; i++)
        if (strcmp(m->axis[i].key, key) == 0)
            return error_set(err, STATUS_INPUT, "--matrix %s is given twice: --matrix %s=a,b,c has all its values", key,
                             key);
    return cJSON_GetObjectItemCaseSensitive(settings, key)
               ? error_set(err, STATUS_INPUT, "%s is in --set and in --matrix", key)
               : STATUS_OK;
}

enum status matrix_read(struct matrix *m, const struct options *o, const cJSON *settings, struct error *err) {
    enum status status = STATUS_OK;
    *m = (struct matrix){.count = 1};
    for (size_t i = 0; i < o->given_count && status == STATUS_OK; i++) {
        if (strcmp(o->given[i].option->name, "matrix") != 0)
            continue;
        m->axis = mem_realloc_array(m->axis, m->axis_count + 1, sizeof *m->axis);
        struct matrix_axis *axis = &m->axis[m->axis_count++];
        *axis = (struct matrix_axis){0};
        status = read_axis(axis, o->given[i].text, err);
        if (status == STATUS_OK)
            status = check_key(m, axis->key, settings, err);
        m->count *= axis->count;
        if (status == STATUS_OK && m->count > MATRIX_MAX)
            status = error_set(err, STATUS_INPUT, "--matrix asks for more than %d combinations", MATRIX_MAX);
    }
    return status;
}

void matrix_release(struct matrix *m) {
    for (size_t i = 0; i < m->axis_count; i++) {
        struct matrix_axis *axis = &m->axis[i];
        for (size_t k = 0; k < axis->count; k++)
            mem_free(axis->word[k]);
        mem_free(axis->word);
        mem_free(axis->key);
        cJSON_Delete(axis->values);
    }
    mem_free(m->axis);
    *m = (struct matrix){0};
}

/* Which value of each axis the combination has. */
static size_t value_of(const struct matrix *m, size_t index, size_t axis) {
    for (size_t i = m->axis_count; i-- > axis + 1;)
        index /= m->axis[i].count;
    return index % m->axis[axis].count;
}

void matrix_apply(const struct matrix *m, size_t index, cJSON *settings) {
    for (size_t i = 0; i < m->axis_count; i++) {
        const cJSON *value = cJSON_GetArrayItem(m->axis[i].values, (int)value_of(m, index, i));
        json_add(settings, m->axis[i].key, cJSON_Duplicate(value, true));
    }
}

void matrix_describe(const struct matrix *m, size_t index, struct buf *out) {
    for (size_t i = 0; i < m->axis_count; i++)
        buf_printf(out, " %s=%s", m->axis[i].key, m->axis[i].word[value_of(m, index, i)]);
}
