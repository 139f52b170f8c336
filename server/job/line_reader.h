/* line_reader.h -- lines that arrive through a descriptor, piece by piece. A line that is too long is dropped and
 * counted. */
#ifndef UNBAKE_JOB_LINE_READER_H
#define UNBAKE_JOB_LINE_READER_H

#include <stdbool.h>
#include <stddef.h>

#include "common/buf.h"
#include "server/job/run.h"

struct line_reader {
    int fd;          /* owned; -1 after its end */
    struct buf line; /* the incomplete last line */
    bool skipping;   /* the current line is too long */
    size_t dropped;
};

/* `fd` (-1: none yet) must not block. */
void line_reader_init(struct line_reader *l, int fd);
/* Reads up to `limit` bytes, as far as there are some, and passes every complete line to `each`. */
void line_reader_read(struct line_reader *l, size_t limit, run_line_fn *each, void *user);
void line_reader_release(struct line_reader *l);

#endif
