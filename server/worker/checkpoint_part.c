/* checkpoint_part.c -- see checkpoint_part.h. */
#include "server/worker/checkpoint_part.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/buf.h"
#include "common/json.h"
#include "common/mem.h"
#include "server/worker/checkpoint_file.h"

#define HEAD_MAX ((size_t)64 << 20) /* some 40 bytes a tile: enough for 1.6 TB of state */
#define READ_BYTES ((size_t)65536)  /* at a time */
#define TILE_VALUES 3               /* in the head: hash, part, offset */

void part_head_release(struct part_head *head) {
    for (size_t i = 0; i < head->array_count; i++) {
        mem_free(head->array[i].name);
        mem_free(head->array[i].tile);
    }
    mem_free(head->array);
    mem_free(head->program);
    mem_free(head->fingerprint);
    *head = (struct part_head){0};
}

/* --- writing ---------------------------------------------------------------------------------- */

static cJSON *hex_of(uint64_t value) {
    char text[17];
    snprintf(text, sizeof text, "%016llx", (unsigned long long)value);
    return cJSON_CreateString(text);
}

char *part_head_text(const struct part_head *head) {
    cJSON *object = cJSON_CreateObject(), *arrays = cJSON_CreateArray();
    json_add_int(object, "number", head->number);
    json_add_int(object, "first", head->first);
    json_add_int(object, "format", head->format);
    json_add_string(object, "program", head->program);
    json_add_string(object, "fingerprint", head->fingerprint);
    json_add_int(object, "iteration", head->iteration);
    json_add(object, "digest", hex_of(head->digest));
    for (size_t i = 0; i < head->array_count; i++) {
        const struct part_array *a = &head->array[i];
        cJSON *array = cJSON_CreateObject(), *tiles = cJSON_CreateArray();
        json_add_string(array, "name", a->name);
        json_add_int(array, "bytes", (int64_t)a->bytes);
        for (size_t t = 0; t < a->tile_count; t++) {
            cJSON_AddItemToArray(tiles, hex_of(a->tile[t].hash));
            cJSON_AddItemToArray(tiles, cJSON_CreateNumber((double)a->tile[t].part));
            cJSON_AddItemToArray(tiles, cJSON_CreateNumber((double)a->tile[t].offset));
        }
        json_add(array, "tiles", tiles);
        cJSON_AddItemToArray(arrays, array);
    }
    json_add(object, "arrays", arrays);
    char *compact = json_text(object), *text = mem_printf("%s\n", compact);
    mem_free(compact);
    cJSON_Delete(object);
    return text;
}

/* --- reading ---------------------------------------------------------------------------------- */

static enum status unreadable(const char *name, const char *what, struct error *err) {
    return error_set(err, STATUS_CORRUPT, "%s: %s", name, what);
}

static bool read_whole(const cJSON *value, double most, double *out) {
    *out = value && cJSON_IsNumber(value) ? value->valuedouble : -1.0;
    return *out >= 0.0 && *out <= most && *out == floor(*out);
}

static bool read_hex(const cJSON *value, uint64_t *out) {
    const char *text = cJSON_GetStringValue(value);
    if (!text || strlen(text) != 16 || strspn(text, "0123456789abcdef") != 16)
        return false;
    *out = strtoull(text, NULL, 16);
    return true;
}

static bool read_member(const cJSON *object, const char *key, double most, double *out) {
    return read_whole(cJSON_GetObjectItemCaseSensitive(object, key), most, out);
}

static bool read_text(const cJSON *object, const char *key, char **out) {
    const char *text = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(object, key));
    *out = text ? mem_strdup(text) : NULL;
    return text != NULL;
}

/* A tile's three values, from `at` on; *at becomes the next tile's first. */
static bool read_tile(const struct part_head *head, const cJSON **at, struct part_tile *tile) {
    double part, offset;
    const cJSON *hash = *at, *second = hash ? hash->next : NULL, *third = second ? second->next : NULL;
    if (!read_hex(hash, &tile->hash) || !read_whole(second, INT_MAX, &part) || !read_whole(third, 0x1p53, &offset))
        return false;
    tile->part = (int)part;
    tile->offset = (uint64_t)offset;
    *at = third->next;
    return tile->part >= head->first && tile->part <= head->number;
}

static bool read_array(const struct part_head *head, const cJSON *object, struct part_array *a) {
    double bytes;
    const cJSON *tiles = cJSON_GetObjectItemCaseSensitive(object, "tiles");
    if (!read_member(object, "bytes", 0x1p44, &bytes) || !read_text(object, "name", &a->name))
        return false;
    a->bytes = (size_t)bytes;
    size_t count = checkpoint_file_tile_count(a->bytes);
    if ((size_t)cJSON_GetArraySize(tiles) != count * TILE_VALUES) /* before memory is taken for what is not there */
        return false;
    a->tile_count = count;
    a->tile = mem_calloc(count ? count : 1, sizeof *a->tile);
    const cJSON *at = tiles ? tiles->child : NULL;
    bool is_good = true;
    for (size_t t = 0; t < count && is_good; t++)
        is_good = read_tile(head, &at, &a->tile[t]);
    return is_good;
}

static bool read_head(struct part_head *head, const cJSON *object) {
    double number, first, format, iteration;
    const cJSON *arrays = cJSON_GetObjectItemCaseSensitive(object, "arrays"), *array;
    if (!read_member(object, "number", INT_MAX, &number) || !read_member(object, "first", number, &first) ||
        first < 1.0 || !read_member(object, "format", INT_MAX, &format) ||
        !read_member(object, "iteration", 0x1p53, &iteration) || !read_text(object, "program", &head->program) ||
        !read_text(object, "fingerprint", &head->fingerprint) ||
        !read_hex(cJSON_GetObjectItemCaseSensitive(object, "digest"), &head->digest) || !cJSON_IsArray(arrays))
        return false;
    head->number = (int)number;
    head->first = (int)first;
    head->format = (int)format;
    head->iteration = (long)iteration;
    int count = cJSON_GetArraySize(arrays);
    head->array = mem_calloc(count > 0 ? (size_t)count : 1, sizeof *head->array);
    bool is_good = true;
    cJSON_ArrayForEach(array, arrays)
        is_good = is_good && read_array(head, array, &head->array[head->array_count++]);
    return is_good;
}

/* The first line of the file, without its newline. */
static enum status read_line(int fd, const char *name, struct buf *line, struct error *err) {
    char *piece = mem_alloc(READ_BYTES);
    enum status status = STATUS_OK;
    const char *end = NULL;
    while (status == STATUS_OK && !end) {
        ssize_t got = pread(fd, piece, READ_BYTES, (off_t)line->length);
        if (got < 0 && errno == EINTR)
            continue;
        end = got > 0 ? memchr(piece, '\n', (size_t)got) : NULL;
        size_t length = end ? (size_t)(end - piece) : got > 0 ? (size_t)got : 0;
        if (got < 0)
            status = error_set_errno(err, errno, "cannot read %s", name);
        else if (got == 0 || !buf_append(line, piece, length))
            status = unreadable(name, "it has no head", err);
    }
    mem_free(piece);
    return status;
}

enum status part_head_read(struct part_head *head, int fd, const char *name, uint64_t *data_start, struct error *err) {
    struct buf line;
    cJSON *object = NULL;
    *head = (struct part_head){0};
    buf_init(&line, HEAD_MAX);
    enum status status = read_line(fd, name, &line, err);
    if (status == STATUS_OK &&
        (json_parse(buf_text(&line), line.length, name, &object, NULL) != STATUS_OK || !read_head(head, object)))
        status = unreadable(name, "its head cannot be read", err);
    *data_start = line.length + 1;
    cJSON_Delete(object);
    buf_release(&line);
    return status;
}
