/* sink.h -- a file that is written from front to back: buffered, little-endian, put in place when
 * whole.
 *
 * A failure is kept, what follows it goes nowhere, and sink_close tells of it. It reads the file back, too: what is put in
 * place is what was given. */
#ifndef UNBAKE_EXPORT_SINK_H
#define UNBAKE_EXPORT_SINK_H

#include <stdint.h>
#include <stdio.h>

#include "common/error.h"
#include "common/vec.h"

#define SINK_FLOAT "%.9g" /* of sink_printf: reads back as the same float */

struct sink {
    char *path, *temporary; /* owned */
    FILE *file;
    uint64_t written, limit; /* bytes */
    uint32_t checksum;       /* CRC-32 of the bytes so far */
    enum status status;     /* of what was written so far */
    int number;             /* errno of the failure; STATUS_LIMIT has none */
};

/* A file of more than `limit` bytes is STATUS_LIMIT; 0: any size will do. */
enum status sink_open(struct sink *s, const char *path, uint64_t limit, struct error *err);

void sink_bytes(struct sink *s, const void *data, size_t length);
void sink_u32(struct sink *s, uint32_t value);
void sink_u64(struct sink *s, uint64_t value);
void sink_float(struct sink *s, float value);
void sink_vec3(struct sink *s, vec3 v);
void sink_printf(struct sink *s, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* Appends the file at `path`, which must have `length` bytes. */
void sink_copy(struct sink *s, const char *path, uint64_t length);

/* Ends it. With `status` (of the caller, *err set) and all that was written OK the file gets its
 * name, else it is removed; returns what went wrong first. */
enum status sink_close(struct sink *s, enum status status, struct error *err);

#endif
