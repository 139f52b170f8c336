/* mapping.h -- a file of an unpacked bundle in memory. Nobody else writes to it, so it does not
 * shrink under its reader. */
#ifndef UNBAKE_INGEST_MAPPING_H
#define UNBAKE_INGEST_MAPPING_H

#include <stddef.h>

#include "common/error.h"

struct mapping {
    void *data; /* NULL: nothing is mapped */
    size_t size;
};

/* `name` is the file's and `kind` what it should be ("a PLY file"), both for messages: an empty file
 * is STATUS_INPUT. */
enum status mapping_open(struct mapping *m, const char *path, const char *name, const char *kind,
                         struct error *err);
void mapping_close(struct mapping *m);

#endif
