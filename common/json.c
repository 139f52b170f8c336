/* json.c -- see json.h. */
#include "common/json.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/buf.h"
#include "common/file.h"
#include "common/mem.h"
#include "common/utf8.h"

#define MAX_DEPTH 64 /* of objects and arrays in each other */
#define NUMBER(macro) NUMBER_(macro)
#define NUMBER_(digits) #digits
#define WHOLE_MAX 9007199254740992.0 /* 2^53: every whole number up to it is a double */

/* cJSON silently drops members when out of memory; here that ends the process, as everywhere. */
__attribute__((constructor)) static void set_allocator(void) {
    cJSON_InitHooks(&(cJSON_Hooks){.malloc_fn = mem_alloc, .free_fn = mem_free});
}

/* Line and column (from 1) of the byte `at`. */
static void locate(const char *text, const char *at, size_t *line, size_t *column) {
    *line = 1;
    *column = 1;
    for (const char *p = text; p < at; p++) {
        if (*p == '\n') {
            (*line)++;
            *column = 1;
        } else {
            (*column)++;
        }
    }
}

/* What cJSON accepts and we do not: nesting too deep for our stack, and NUL within strings, where cJSON would
 * truncate. NULL when there is nothing, else `where` is set. */
static const char *own_fault(const char *text, size_t length, const char **where) {
    int depth = 0;
    bool in_string = false;
    for (size_t i = 0; i < length; i++) {
        char c = text[i];
        if (in_string) {
            if (c == '\\' && length - i > 5 && memcmp(text + i + 1, "u0000", 5) == 0) {
                *where = text + i;
                return "has a string with a NUL character (\\u0000)";
            }
            if (c == '\\')
                i++;
            else if (c == '"')
                in_string = false;
        } else if (c == '"') {
            in_string = true;
        } else if (c == '[' || c == '{') {
            if (++depth > MAX_DEPTH) {
                *where = text + i;
                return "is nested more than " NUMBER(MAX_DEPTH) " deep";
            }
        } else if (c == ']' || c == '}') {
            depth--;
        }
    }
    return NULL;
}

static int by_text(const void *a, const void *b) { return strcmp(*(const char *const *)a, *(const char *const *)b); }

/* A duplicate key of this object; NULL when there is none. Sorts, since a megabyte of keys must not take quadratic
 * time. */
static const char *own_duplicate(const cJSON *object) {
    size_t count = 0, filled = 0;
    for (const cJSON *member = object->child; member; member = member->next)
        count++;
    if (count < 2)
        return NULL;
    const char **key = mem_array(count, sizeof *key), *twice = NULL;
    for (const cJSON *member = object->child; member; member = member->next)
        key[filled++] = member->string;
    qsort(key, count, sizeof *key, by_text);
    for (size_t i = 1; i < count && !twice; i++)
        if (strcmp(key[i - 1], key[i]) == 0)
            twice = key[i];
    mem_free(key);
    return twice;
}

/* A duplicate key of any object in the tree; NULL when there is none. */
static const char *duplicate_key(const cJSON *value) {
    const char *twice = cJSON_IsObject(value) ? own_duplicate(value) : NULL;
    for (const cJSON *child = value->child; child && !twice; child = child->next)
        twice = duplicate_key(child);
    return twice;
}

enum status json_parse(const char *text, size_t length, const char *what, cJSON **value, struct error *err) {
    *value = NULL;
    size_t line, column, bad = 0;
    const char *where = text;
    if (length >= 3 && memcmp(text, "\xef\xbb\xbf", 3) == 0) {
        text += 3;
        length -= 3;
    }
    if (memchr(text, '\0', length))
        return error_set(err, STATUS_INPUT, "%s is not JSON: it contains a NUL byte", what);
    if (!utf8_valid(text, length, &bad)) {
        locate(text, text + bad, &line, &column);
        return error_set(err, STATUS_INPUT, "%s is not UTF-8: bad byte at line %zu, column %zu", what, line, column);
    }
    const char *fault = own_fault(text, length, &where);
    if (fault) {
        locate(text, where, &line, &column);
        return error_set(err, STATUS_INPUT, "%s %s at line %zu, column %zu", what, fault, line, column);
    }
    const char *end = NULL;
    cJSON *parsed = cJSON_ParseWithLengthOpts(text, length, &end, false);
    if (!parsed) {
        locate(text, end ? end : text, &line, &column);
        return error_set(err, STATUS_INPUT, "%s is not JSON: syntax error at line %zu, column %zu", what, line, column);
    }
    while (end < text + length && strchr(" \t\r\n", *end))
        end++;
    if (end < text + length) {
        locate(text, end, &line, &column);
        cJSON_Delete(parsed);
        return error_set(err, STATUS_INPUT, "%s has text after the JSON at line %zu, column %zu", what, line, column);
    }
    const char *twice = duplicate_key(parsed);
    if (twice) {
        error_set(err, STATUS_INPUT, "%s has the key \"%.100s\" twice in one object", what, twice);
        cJSON_Delete(parsed);
        return STATUS_INPUT;
    }
    *value = parsed;
    return STATUS_OK;
}

enum status json_read(const char *path, size_t limit, cJSON **value, struct error *err) {
    *value = NULL;
    struct buf content;
    buf_init(&content, limit);
    enum status status = file_read(path, &content, err);
    if (status == STATUS_OK)
        status = json_parse(buf_text(&content), content.length, path, value, err);
    buf_release(&content);
    return status;
}

/* cJSON prints 15 digits where that is equal within a relative tolerance, and so loses the end of
 * whole numbers near 2^53 and the last bits of others. The numbers that it would not print
 * exactly become raw text, the shortest of 15 or 17 digits that reads as the same number. */
static void write_out_numbers(cJSON *first) {
    for (cJSON *value = first; value; value = value->next) {
        double number = value->valuedouble;
        write_out_numbers(value->child);
        if (!cJSON_IsNumber(value) || !isfinite(number) || number == (double)value->valueint)
            continue;
        char text[32];
        bool is_whole = number == floor(number) && fabs(number) <= WHOLE_MAX;
        snprintf(text, sizeof text, is_whole ? "%.0f" : "%.15g", number);
        if (strtod(text, NULL) != number)
            snprintf(text, sizeof text, "%.17g", number);
        cJSON *raw = cJSON_CreateRaw(text);
        value->type = cJSON_Raw;
        value->valuestring = raw->valuestring;
        raw->valuestring = NULL;
        cJSON_Delete(raw);
    }
}

/* The JSON text with characters that are not visible, which are in strings, as escapes: what is printed on a
 * terminal, by us or by curl, is then what it looks like. The caller's. */
static char *escape_invisible(const char *text) {
    size_t left = strlen(text), used = 0;
    char *out = mem_array(left + 1, 6); /* DEL, a byte, becomes six; a character of four bytes twelve */
    uint32_t c;
    for (size_t size; left > 0; text += size, left -= size) {
        size = utf8_next(text, left, &c);
        bool is_plain = size == 0 || c < 0x20 || utf8_kind(c) == UTF8_VISIBLE; /* line breaks, too */
        size = size ? size : 1;
        if (is_plain) {
            memcpy(out + used, text, size);
            used += size;
        } else if (c < 0x10000) {
            used += (size_t)sprintf(out + used, "\\u%04x", (unsigned)c);
        } else {
            used += (size_t)sprintf(out + used, "\\u%04x\\u%04x", (unsigned)(0xd7c0 + (c >> 10)),
                                    (unsigned)(0xdc00 + (c & 0x3ff)));
        }
    }
    out[used] = '\0';
    char *fitted = mem_strdup(out);
    mem_free(out);
    return fitted;
}

static char *print(const cJSON *value, bool with_line_breaks) {
    cJSON *copy = cJSON_Duplicate(value, true);
    write_out_numbers(copy);
    char *printed = with_line_breaks ? cJSON_Print(copy) : cJSON_PrintUnformatted(copy);
    char *text = escape_invisible(printed ? printed : "null");
    cJSON_free(printed);
    cJSON_Delete(copy);
    return text;
}

char *json_text(const cJSON *value) { return print(value, false); }

char *json_page(const cJSON *value) { return print(value, true); }

static const char *type_name(const cJSON *value) {
    return cJSON_IsNumber(value)   ? "a number"
           : cJSON_IsString(value) ? "a string"
           : cJSON_IsBool(value)   ? "true or false"
           : cJSON_IsArray(value)  ? "an array"
           : cJSON_IsObject(value) ? "an object"
                                   : "null";
}

/* The member, or NULL when it is absent or null. */
static const cJSON *member(const cJSON *object, const char *key) {
    const cJSON *value = cJSON_GetObjectItemCaseSensitive(object, key);
    return cJSON_IsNull(value) ? NULL : value;
}

enum status json_number(const cJSON *object, const char *key, const char *what, double fallback, double *value,
                        struct error *err) {
    const cJSON *found = member(object, key);
    *value = fallback;
    if (!found)
        return STATUS_OK;
    if (!cJSON_IsNumber(found))
        return error_set(err, STATUS_INPUT, "%s: \"%s\" must be a number, found %s", what, key, type_name(found));
    if (!isfinite(found->valuedouble))
        return error_set(err, STATUS_INPUT, "%s: \"%s\" is not a finite number", what, key);
    *value = found->valuedouble;
    return STATUS_OK;
}

enum status json_string(const cJSON *object, const char *key, const char *what, const char *fallback,
                        const char **value, struct error *err) {
    const cJSON *found = member(object, key);
    *value = fallback;
    if (!found)
        return STATUS_OK;
    if (!cJSON_IsString(found))
        return error_set(err, STATUS_INPUT, "%s: \"%s\" must be a string, found %s", what, key, type_name(found));
    *value = found->valuestring;
    return STATUS_OK;
}

enum status json_bool(const cJSON *object, const char *key, const char *what, bool fallback, bool *value,
                      struct error *err) {
    const cJSON *found = member(object, key);
    *value = fallback;
    if (!found)
        return STATUS_OK;
    if (!cJSON_IsBool(found))
        return error_set(err, STATUS_INPUT, "%s: \"%s\" must be true or false, found %s", what, key, type_name(found));
    *value = cJSON_IsTrue(found);
    return STATUS_OK;
}

void json_add(cJSON *object, const char *key, cJSON *value) { cJSON_AddItemToObject(object, key, value); }

cJSON *json_new_string(const char *text) {
    cJSON *value = cJSON_CreateString(text);
    char *at = value->valuestring;
    size_t length = strlen(at), bad;
    while (!utf8_valid(at, length, &bad)) {
        at[bad] = '?';
        at += bad + 1;
        length -= bad + 1;
    }
    return value;
}

void json_add_string(cJSON *object, const char *key, const char *value) {
    json_add(object, key, value ? json_new_string(value) : cJSON_CreateNull());
}

void json_add_number(cJSON *object, const char *key, double value) {
    json_add(object, key, isfinite(value) ? cJSON_CreateNumber(value) : cJSON_CreateNull());
}

void json_add_int(cJSON *object, const char *key, int64_t value) {
    json_add(object, key, cJSON_CreateNumber((double)value));
}

void json_add_bool(cJSON *object, const char *key, bool value) { json_add(object, key, cJSON_CreateBool(value)); }
