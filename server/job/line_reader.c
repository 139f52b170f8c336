/* line_reader.c -- see line_reader.h. */
#include "server/job/line_reader.h"

#include <errno.h>
#include <string.h>
#include <unistd.h>

#include "server/worker/progress.h"

void line_reader_init(struct line_reader *l, int fd) {
    *l = (struct line_reader){.fd = fd};
    buf_init(&l->line, PROGRESS_LINE_MAX);
}

void line_reader_release(struct line_reader *l) {
    if (l->fd >= 0)
        close(l->fd);
    buf_release(&l->line);
}

static void take(struct line_reader *l, const char *data, size_t length, run_line_fn *each, void *user) {
    while (length > 0) {
        const char *newline = memchr(data, '\n', length);
        size_t part = newline ? (size_t)(newline - data) : length;
        if (!l->skipping && !buf_append(&l->line, data, part)) {
            l->skipping = true;
            l->dropped++;
        }
        if (!newline)
            return;
        if (!l->skipping)
            each(user, buf_text(&l->line), l->line.length);
        l->skipping = false;
        buf_clear(&l->line);
        data = newline + 1;
        length -= part + 1;
    }
}

void line_reader_read(struct line_reader *l, size_t limit, run_line_fn *each, void *user) {
    char chunk[16384];
    for (size_t total = 0; l->fd >= 0 && total < limit;) {
        ssize_t got = read(l->fd, chunk, sizeof chunk);
        if (got < 0 && errno == EINTR)
            continue;
        if (got < 0 && errno == EAGAIN)
            return;
        if (got <= 0) {
            close(l->fd);
            l->fd = -1;
            return;
        }
        total += (size_t)got;
        take(l, chunk, (size_t)got, each, user);
    }
}
