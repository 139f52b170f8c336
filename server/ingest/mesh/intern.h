/* intern.h -- string interning: equal byte strings get the same number, from 0 in order of first use. */
#ifndef UNBAKE_INGEST_MESH_INTERN_H
#define UNBAKE_INGEST_MESH_INTERN_H

#include <stddef.h>
#include <stdint.h>

struct intern {
    size_t count;
    size_t capacity;            /* of entries */
    struct intern_entry *entry; /* [count]; owned */
    size_t table_size;
    uint32_t *table; /* entries by hash; owned */
    size_t used, room;
    char *bytes; /* of all strings, concatenated; owned */
};

void intern_init(struct intern *in);
void intern_release(struct intern *in);
/* Number of the string, which is copied when it is new. */
uint32_t intern_number(struct intern *in, const void *bytes, size_t length);
/* The bytes of a string, borrowed until the next call of intern_number. */
const char *intern_text(const struct intern *in, size_t number);

#endif
