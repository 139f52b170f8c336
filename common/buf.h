/* buf.h -- a growing byte buffer with a hard cap, always NUL-terminated. */
#ifndef UNBAKE_COMMON_BUF_H
#define UNBAKE_COMMON_BUF_H

#include <stdbool.h>
#include <stddef.h>

struct buf {
    char *data;    /* NUL-terminated after the first append; NULL before; owned */
    size_t length; /* bytes, the NUL not counted */
    size_t capacity;
    size_t limit;    /* bytes; an append that would pass it is refused */
    bool overflowed; /* an append was refused: the content is not whole */
};

void buf_init(struct buf *b, size_t limit);
void buf_release(struct buf *b);
void buf_clear(struct buf *b); /* empties, keeps the memory */

/* False, with `overflowed` set and nothing appended, when the limit would be passed. */
bool buf_append(struct buf *b, const void *data, size_t length);
bool buf_puts(struct buf *b, const char *text);
bool buf_printf(struct buf *b, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* Removes the first `length` bytes. */
void buf_consume(struct buf *b, size_t length);

/* The content as a C string (empty, never NULL); borrowed until the next change. */
const char *buf_text(const struct buf *b);

/* Takes the content out as a string of the caller's (mem_free) and leaves b empty. */
char *buf_detach(struct buf *b);

#endif
