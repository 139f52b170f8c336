/* mapping.h -- memory-mapped files of an unpacked bundle. No other process writes to them, so they cannot shrink
 * while mapped. */
#ifndef UNBAKE_INGEST_MAPPING_H
#define UNBAKE_INGEST_MAPPING_H

#include <stdbool.h>
#include <stddef.h>

#include "common/error.h"

struct mapping {
    void *data; /* NULL: nothing is mapped */
    size_t size;
    bool is_borrowed; /* not mapped here: nothing to undo */
};

/* `name` and `kind` ("a PLY file") are for messages; an empty file is STATUS_INPUT. */
enum status mapping_open(struct mapping *m, const char *path, const char *name, const char *kind, struct error *err);
void mapping_close(struct mapping *m);

#endif
