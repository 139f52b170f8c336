/* sink.c -- see sink.h. */
#include "server/export/sink.h"

#include <endian.h>
#include <errno.h>
#include <stdarg.h>
#include <stdbool.h>
#include <string.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"

enum status sink_open(struct sink *s, const char *path, uint64_t limit, struct error *err) {
    *s = (struct sink){.path = mem_strdup(path), .temporary = mem_printf("%s.part", path),
                       .limit = limit ? limit : UINT64_MAX};
    s->file = fopen(s->temporary, "wbe");
    if (s->file)
        return STATUS_OK;
    enum status status = error_set_errno(err, errno, "cannot create %s", s->temporary);
    mem_free(s->temporary);
    mem_free(s->path);
    return status;
}

static void fail(struct sink *s, int number) {
    s->status = STATUS_IO;
    s->number = number;
}

/* Whether `length` more bytes may be written. */
static bool admit(struct sink *s, uint64_t length) {
    if (s->status == STATUS_OK && length > s->limit - s->written)
        s->status = STATUS_LIMIT;
    if (s->status != STATUS_OK)
        return false;
    s->written += length;
    return true;
}

void sink_bytes(struct sink *s, const void *data, size_t length) {
    if (admit(s, length) && fwrite_unlocked(data, 1, length, s->file) != length)
        fail(s, errno);
}

void sink_u32(struct sink *s, uint32_t value) {
    value = htole32(value);
    sink_bytes(s, &value, sizeof value);
}

void sink_u64(struct sink *s, uint64_t value) {
    value = htole64(value);
    sink_bytes(s, &value, sizeof value);
}

void sink_float(struct sink *s, float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    sink_u32(s, bits);
}

void sink_vec3(struct sink *s, vec3 v) {
    sink_float(s, v.x);
    sink_float(s, v.y);
    sink_float(s, v.z);
}

void sink_printf(struct sink *s, const char *format, ...) {
    if (s->status != STATUS_OK)
        return;
    va_list arguments;
    va_start(arguments, format);
    int length = vfprintf(s->file, format, arguments);
    va_end(arguments);
    if (length < 0)
        fail(s, errno);
    else
        admit(s, (uint64_t)length);
}

void sink_copy(struct sink *s, const char *path, uint64_t length) {
    char block[1 << 16];
    FILE *from = fopen(path, "rbe");
    if (!from && s->status == STATUS_OK)
        fail(s, errno);
    while (from && s->status == STATUS_OK && length > 0) {
        size_t wanted = length < sizeof block ? (size_t)length : sizeof block;
        size_t got = fread(block, 1, wanted, from);
        sink_bytes(s, block, got);
        length -= got;
        if (got < wanted && s->status == STATUS_OK)
            fail(s, ferror(from) ? errno : EIO);
    }
    if (from)
        fclose(from);
}

enum status sink_close(struct sink *s, enum status status, struct error *err) {
    bool had_failed = ferror(s->file) != 0;
    if ((fclose(s->file) != 0 || had_failed) && s->status == STATUS_OK)
        fail(s, had_failed ? EIO : errno);
    if (status == STATUS_OK && s->status == STATUS_LIMIT)
        status = error_set(err, STATUS_LIMIT, "%s would be larger than %llu bytes", s->path,
                           (unsigned long long)s->limit);
    else if (status == STATUS_OK && s->status != STATUS_OK)
        status = error_set_errno(err, s->number, "cannot write %s", s->path);
    if (status == STATUS_OK)
        status = file_put_in_place(s->temporary, s->path, err);
    else
        unlink(s->temporary);
    mem_free(s->temporary);
    mem_free(s->path);
    return status;
}
