/* intern.h -- numbers for byte strings: equal strings get the same one, from 0 in order of first use. */
#ifndef UNBAKE_INGEST_INTERN_H
#define UNBAKE_INGEST_INTERN_H

#include <stddef.h>
#include <stdint.h>

struct intern {
    size_t count;
    size_t capacity;    /* of entries */
    struct intern_entry *entry; /* [count]; owned */
    size_t table_size;
    uint32_t *table;    /* entries by hash; owned */
    size_t used, room;
    char *bytes;        /* of all strings, one after the other; owned */
};

void intern_init(struct intern *in);
void intern_release(struct intern *in);
/* The number of the string, which is copied where it is new. */
uint32_t intern_number(struct intern *in, const void *bytes, size_t length);

#endif
