/* sink.c -- see sink.h. */
#include "server/export/sink.h"

#include <endian.h>
#include <errno.h>
#include <stdarg.h>
#include <stdbool.h>
#include <string.h>
#include <unistd.h>
#include <zlib.h>

#include "common/file.h"
#include "common/mem.h"

enum status sink_open(struct sink *s, const char *path, uint64_t limit, struct error *err) {
    *s = (struct sink){
        .path = mem_strdup(path), .temporary = mem_printf("%s.part", path), .limit = limit ? limit : UINT64_MAX};
    s->file = fopen(s->temporary, "wbe");
    if (s->file)
        return STATUS_OK;
    enum status status = error_set_errno(err, errno, "cannot create %s", s->temporary);
    mem_free(s->temporary);
    mem_free(s->path);
    return status;
}

static void fail(struct sink *s, int error_number) {
    s->status = STATUS_IO;
    s->error_number = error_number;
}

/* Whether `length` more bytes may be written. */
static bool reserve(struct sink *s, uint64_t length) {
    if (s->status == STATUS_OK && length > s->limit - s->written)
        s->status = STATUS_LIMIT;
    if (s->status != STATUS_OK)
        return false;
    s->written += length;
    return true;
}

void sink_bytes(struct sink *s, const void *data, size_t length) {
    if (length == 0 || !reserve(s, length)) /* crc32 of NULL is that of nothing: it would begin anew */
        return;
    s->checksum = (uint32_t)crc32_z(s->checksum, data, length);
    if (fwrite_unlocked(data, 1, length, s->file) != length)
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
    char line[512], *text = line;
    va_list arguments, again;
    va_start(arguments, format);
    va_copy(again, arguments);
    int length = vsnprintf(line, sizeof line, format, arguments);
    if (length >= (int)sizeof line) {
        text = mem_alloc((size_t)length + 1);
        vsnprintf(text, (size_t)length + 1, format, again);
    }
    va_end(again);
    va_end(arguments);
    if (length < 0 && s->status == STATUS_OK)
        fail(s, errno);
    else if (length > 0)
        sink_bytes(s, text, (size_t)length);
    if (text != line)
        mem_free(text);
}

void sink_offset(struct sink *s, const char *prefix, const double offset[3], const char *suffix) {
    if (offset[0] != 0.0 || offset[1] != 0.0 || offset[2] != 0.0)
        sink_printf(s, "%s unbake offset %.17g %.17g %.17g%s", prefix, offset[0], offset[1], offset[2], suffix);
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

/* Reads through the page cache; does not prove that the data is on disk. */
static enum status read_back(const struct sink *s, struct error *err) {
    char block[1 << 16];
    uint64_t length = 0;
    size_t got;
    uLong checksum = 0;
    FILE *file = fopen(s->temporary, "rbe");
    if (!file)
        return error_set_errno(err, errno, "cannot read back %s", s->temporary);
    while ((got = fread_unlocked(block, 1, sizeof block, file)) > 0) {
        checksum = crc32_z(checksum, (const Bytef *)block, got);
        length += got;
    }
    enum status status = ferror(file) ? error_set_errno(err, errno, "cannot read back %s", s->temporary) : STATUS_OK;
    fclose(file);
    if (status == STATUS_OK && (length != s->written || checksum != s->checksum))
        status = error_set(err, STATUS_CORRUPT, "%s: read back, its %llu bytes are not the %llu that were written",
                           s->path, (unsigned long long)length, (unsigned long long)s->written);
    return status;
}

enum status sink_close(struct sink *s, enum status status, struct error *err) {
    bool had_failed = ferror(s->file) != 0;
    if ((fclose(s->file) != 0 || had_failed) && s->status == STATUS_OK)
        fail(s, had_failed ? EIO : errno);
    if (status == STATUS_OK && s->status == STATUS_LIMIT)
        status =
            error_set(err, STATUS_LIMIT, "%s would be larger than %llu bytes", s->path, (unsigned long long)s->limit);
    else if (status == STATUS_OK && s->status != STATUS_OK)
        status = error_set_errno(err, s->error_number, "cannot write %s", s->path);
    if (status == STATUS_OK)
        status = read_back(s, err);
    if (status == STATUS_OK)
        status = file_put_in_place(s->temporary, s->path, err);
    else
        unlink(s->temporary);
    mem_free(s->temporary);
    mem_free(s->path);
    return status;
}
