/* file_stream.c -- see file_stream.h. */
#include "server/transport/file_stream.h"

#include <errno.h>
#include <string.h>
#include <unistd.h>

#include "common/mem.h"

#define AHEAD_BYTES ((size_t)256 << 10) /* read at once, some 100 us from memory; each open download holds this much */

struct file_stream {
    struct stream base;
    int fd;
    uint64_t at, end; /* what is still to be read */
    char *ahead;      /* [AHEAD_BYTES]; [used, count) is still to be sent */
    size_t used, count;
    bool has_failed;
};

static ssize_t file_stream_read(struct stream *base, char *to, size_t size) {
    struct file_stream *f = (struct file_stream *)base;
    size_t count = f->count - f->used;
    if (count == 0)
        return f->has_failed || f->at == f->end ? -1 : 0;
    count = count < size ? count : size;
    memcpy(to, f->ahead + f->used, count);
    f->used += count;
    return (ssize_t)count;
}

static bool file_stream_fill(struct stream *base) {
    struct file_stream *f = (struct file_stream *)base;
    uint64_t left = f->end - f->at;
    ssize_t got;
    if (!f->ahead)
        f->ahead = mem_alloc(AHEAD_BYTES);
    do
        got = pread(f->fd, f->ahead, left < AHEAD_BYTES ? (size_t)left : AHEAD_BYTES, (off_t)f->at);
    while (got < 0 && errno == EINTR);
    f->used = 0;
    f->count = got > 0 ? (size_t)got : 0;
    f->at += f->count;
    f->has_failed = got <= 0;
    return true;
}

static void file_stream_close(struct stream *base) {
    struct file_stream *f = (struct file_stream *)base;
    close(f->fd);
    mem_free(f->ahead);
    mem_free(f);
}

struct stream *file_stream_new(int fd, uint64_t offset, uint64_t length) {
    struct file_stream *f = mem_calloc(1, sizeof *f);
    f->base.read = file_stream_read;
    f->base.fill = file_stream_fill;
    f->base.close = file_stream_close;
    f->base.is_sized = true;
    f->fd = fd;
    f->at = offset;
    f->end = offset + length;
    return &f->base;
}
