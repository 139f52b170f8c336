/* intern.c -- see intern.h. Open addressing with a mixed FNV hash. */
#include "server/ingest/mesh/intern.h"

#include <string.h>

#include "common/mem.h"
#include "common/rng.h"

#define NONE UINT32_MAX /* an empty place of the table */

struct intern_entry {
    uint64_t hash;
    size_t offset, length;
};

void intern_init(struct intern *in) { *in = (struct intern){0}; }

void intern_release(struct intern *in) {
    mem_free(in->entry);
    mem_free(in->table);
    mem_free(in->bytes);
    *in = (struct intern){0};
}

static uint64_t hash_of(const unsigned char *bytes, size_t length) {
    uint64_t hash = UINT64_C(0xcbf29ce484222325);
    for (size_t i = 0; i < length; i++)
        hash = (hash ^ bytes[i]) * UINT64_C(0x100000001b3);
    return rng_mix64(hash);
}

static void grow_table(struct intern *in) {
    mem_free(in->table);
    in->table_size = in->table_size ? 2 * in->table_size : 64;
    in->table = mem_array(in->table_size, sizeof *in->table);
    memset(in->table, 0xff, in->table_size * sizeof *in->table);
    for (size_t i = 0; i < in->count; i++) {
        size_t slot = in->entry[i].hash & (in->table_size - 1);
        while (in->table[slot] != NONE)
            slot = (slot + 1) & (in->table_size - 1);
        in->table[slot] = (uint32_t)i;
    }
}

static void append(struct intern *in, const void *bytes, size_t length, uint64_t hash) {
    if (in->count == in->capacity) {
        in->capacity = in->capacity ? 2 * in->capacity : 32;
        in->entry = mem_realloc_array(in->entry, in->capacity, sizeof *in->entry);
    }
    if (length > in->room - in->used) {
        in->room = 2 * in->room + length;
        in->bytes = mem_realloc_array(in->bytes, in->room, 1);
    }
    if (length > 0)
        memcpy(in->bytes + in->used, bytes, length);
    in->entry[in->count++] = (struct intern_entry){hash, in->used, length};
    in->used += length;
}

uint32_t intern_number(struct intern *in, const void *bytes, size_t length) {
    if (2 * (in->count + 1) > in->table_size)
        grow_table(in);
    uint64_t hash = hash_of(bytes, length);
    size_t slot = hash & (in->table_size - 1);
    for (; in->table[slot] != NONE; slot = (slot + 1) & (in->table_size - 1)) {
        const struct intern_entry *e = &in->entry[in->table[slot]];
        if (e->hash == hash && e->length == length &&
            (length == 0 || memcmp(in->bytes + e->offset, bytes, length) == 0))
            return in->table[slot];
    }
    in->table[slot] = (uint32_t)in->count;
    append(in, bytes, length, hash);
    return (uint32_t)in->count - 1;
}

const char *intern_text(const struct intern *in, size_t number) { return in->bytes + in->entry[number].offset; }
