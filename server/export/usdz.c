/* usdz.c -- the archive of usd.h: "USDZ File Format Specification", which is a zip archive (PKWARE APPNOTE 6.3) without
 * compression or encryption whose files begin at multiples of 64 bytes, so that they can be mapped into memory. The
 * room for that is made by an extra field of the header. */
#include "server/export/usd.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <zlib.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/export/sink.h"

#define LOCAL_MAGIC 0x04034b50 /* of a file's header, of its entry in the directory, of the end (APPNOTE.TXT, 4.3) */
#define CENTRAL_MAGIC 0x02014b50
#define END_MAGIC 0x06054b50
#define LOCAL_BYTES 30  /* of a file's header without name and extra field */
#define ALIGNMENT 64    /* bytes, of each file's contents, as the specification of usdz asks for */
#define EXTRA_ID 0x1986 /* of padding, as Pixar's writer has it */
#define EXTRA_HEAD 4    /* bytes: its id and length */
#define VERSION 10      /* 1.0: stored files */
#define NO_TIME 0
#define NO_DATE 0x0021 /* 1 January 1980: the same input gives the same bytes */

struct entry {
    const char *name;
    char *path; /* owned */
    uint32_t crc, size, offset;
};

static void put_u16(struct sink *out, uint32_t value) {
    const unsigned char byte[2] = {(unsigned char)(value & 0xff), (unsigned char)(value >> 8)};
    sink_bytes(out, byte, 2);
}

/* Sets size and checksum of the file. */
static enum status measure(struct entry *e, struct error *err) {
    char block[1 << 16];
    uint64_t size = 0;
    uLong crc = 0;
    size_t got;
    FILE *file = fopen(e->path, "rbe");
    if (!file && errno == ENOENT)
        return error_set(err, STATUS_LIMIT, "%s, which is a part of it, was not written", e->path);
    if (!file)
        return error_set_errno(err, errno, "cannot open %s", e->path);
    while ((got = fread(block, 1, sizeof block, file)) > 0) {
        crc = crc32_z(crc, (const Bytef *)block, got);
        size += got;
    }
    enum status status = ferror(file) ? error_set_errno(err, errno, "cannot read %s", e->path) : STATUS_OK;
    fclose(file);
    if (status == STATUS_OK && size > UINT32_MAX)
        status = error_set(err, STATUS_LIMIT, "%s has more than 4 GiB", e->name);
    e->crc = (uint32_t)crc;
    e->size = (uint32_t)size;
    return status;
}

/* What local and central header have in common. */
static void put_common(struct sink *out, const struct entry *e, uint32_t extra) {
    put_u16(out, VERSION);
    put_u16(out, 0); /* flags */
    put_u16(out, 0); /* stored */
    put_u16(out, NO_TIME);
    put_u16(out, NO_DATE);
    sink_u32(out, e->crc);
    sink_u32(out, e->size);
    sink_u32(out, e->size);
    put_u16(out, (uint32_t)strlen(e->name));
    put_u16(out, extra);
}

static void put_file(struct sink *out, struct entry *e) {
    static const char zeros[ALIGNMENT];
    e->offset = (uint32_t)out->written;
    uint64_t data = out->written + LOCAL_BYTES + strlen(e->name) + EXTRA_HEAD;
    uint32_t padding = (uint32_t)(-data % ALIGNMENT);
    sink_u32(out, LOCAL_MAGIC);
    put_common(out, e, EXTRA_HEAD + padding);
    sink_bytes(out, e->name, strlen(e->name));
    put_u16(out, EXTRA_ID);
    put_u16(out, padding);
    sink_bytes(out, zeros, padding);
    sink_copy(out, e->path, e->size);
}

static void put_directory(struct sink *out, const struct entry *entry, size_t count) {
    uint32_t begin = (uint32_t)out->written;
    for (size_t i = 0; i < count; i++) {
        sink_u32(out, CENTRAL_MAGIC);
        put_u16(out, VERSION); /* made by */
        put_common(out, &entry[i], 0);
        put_u16(out, 0);  /* comment */
        put_u16(out, 0);  /* disk */
        put_u16(out, 0);  /* internal attributes */
        sink_u32(out, 0); /* external ones */
        sink_u32(out, entry[i].offset);
        sink_bytes(out, entry[i].name, strlen(entry[i].name));
    }
    uint32_t length = (uint32_t)out->written - begin;
    sink_u32(out, END_MAGIC);
    put_u16(out, 0);
    put_u16(out, 0);
    put_u16(out, (uint32_t)count);
    put_u16(out, (uint32_t)count);
    sink_u32(out, length);
    sink_u32(out, begin);
    put_u16(out, 0);
}

enum status usdz_write(const char *path, const char *dir, const char *const *name, size_t count, struct error *err) {
    struct sink out;
    struct entry *entry = mem_calloc(count, sizeof *entry);
    enum status status = STATUS_OK;
    for (size_t i = 0; i < count; i++)
        entry[i] = (struct entry){.name = name[i], .path = file_join(dir, name[i])};
    for (size_t i = 0; i < count && status == STATUS_OK; i++)
        status = measure(&entry[i], err);
    if (status == STATUS_OK)
        status = sink_open(&out, path, UINT32_MAX, err);
    if (status == STATUS_OK) {
        for (size_t i = 0; i < count; i++)
            put_file(&out, &entry[i]);
        put_directory(&out, entry, count);
        status = sink_close(&out, STATUS_OK, err);
    }
    for (size_t i = 0; i < count; i++)
        mem_free(entry[i].path);
    mem_free(entry);
    return status;
}
