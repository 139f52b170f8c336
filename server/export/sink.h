/* sink.h -- sequential file writer: buffered, little-endian, moved into place when complete.
 *
 * Errors are sticky: later writes do nothing, and sink_close reports the first one. Before the file is moved into
 * place it is read back and compared by checksum. */
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
    enum status status;      /* of the writes so far */
    int error_number;        /* errno of the failure; 0 for STATUS_LIMIT */
};

/* `limit` is the maximum size in bytes (beyond it STATUS_LIMIT); 0: none. */
enum status sink_open(struct sink *s, const char *path, uint64_t limit, struct error *err);

void sink_bytes(struct sink *s, const void *data, size_t length);
void sink_u32(struct sink *s, uint32_t value);
void sink_u64(struct sink *s, uint64_t value);
void sink_float(struct sink *s, float value);
void sink_vec3(struct sink *s, vec3 v);
void sink_printf(struct sink *s, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* PREFIX, " unbake offset X Y Z" and SUFFIX if the offset (struct mesh) is not 0; else nothing. */
void sink_offset(struct sink *s, const char *prefix, const double offset[3], const char *suffix);
/* Appends the file at `path`, of `length` bytes. */
void sink_copy(struct sink *s, const char *path, uint64_t length);

/* Closes the file. If `status` (the caller's, with *err set) and all writes are OK the file is moved into place, else
 * it is removed. Returns the first error. */
enum status sink_close(struct sink *s, enum status status, struct error *err);

#endif
