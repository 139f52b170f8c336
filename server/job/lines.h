/* lines.h -- lines that arrive through a descriptor, piece by piece. A line that is too long is dropped and counted. */
#ifndef UNBAKE_JOB_LINES_H
#define UNBAKE_JOB_LINES_H

#include <stdbool.h>
#include <stddef.h>

#include "common/buf.h"
#include "server/job/run.h"

struct lines {
    int fd;          /* owned; -1 after its end */
    struct buf line; /* the incomplete last line */
    bool skipping;   /* the current line is too long */
    size_t dropped;
};

/* `fd` (-1: none yet) must not block. */
void lines_init(struct lines *l, int fd);
/* Reads up to `limit` bytes, as far as there are some, and passes every complete line to `each`. */
void lines_read(struct lines *l, size_t limit, run_line_fn *each, void *user);
void lines_release(struct lines *l);

#endif
