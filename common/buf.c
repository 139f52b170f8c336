/* buf.c -- see buf.h. */
#include "common/buf.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "common/mem.h"

void buf_init(struct buf *b, size_t limit) { *b = (struct buf){.limit = limit}; }

void buf_release(struct buf *b) {
    mem_free(b->data);
    *b = (struct buf){.limit = b->limit};
}

void buf_clear(struct buf *b) {
    b->length = 0;
    b->overflowed = false;
    if (b->data)
        b->data[0] = '\0';
}

static bool reserve(struct buf *b, size_t extra) {
    if (extra > b->limit - b->length) {
        b->overflowed = true;
        return false;
    }
    size_t need = b->length + extra + 1;
    if (need > b->capacity) {
        size_t grown = b->capacity < 64 ? 64 : b->capacity * 2;
        b->capacity = grown < need ? need : grown;
        b->data = mem_realloc_array(b->data, b->capacity, 1);
    }
    return true;
}

bool buf_append(struct buf *b, const void *data, size_t length) {
    if (!reserve(b, length))
        return false;
    if (length)
        memcpy(b->data + b->length, data, length);
    b->length += length;
    b->data[b->length] = '\0';
    return true;
}

bool buf_puts(struct buf *b, const char *text) { return buf_append(b, text, strlen(text)); }

bool buf_printf(struct buf *b, const char *format, ...) {
    va_list args;
    va_start(args, format);
    int length = vsnprintf(NULL, 0, format, args);
    va_end(args);
    if (length < 0 || !reserve(b, (size_t)length))
        return false;
    va_start(args, format);
    vsnprintf(b->data + b->length, (size_t)length + 1, format, args);
    va_end(args);
    b->length += (size_t)length;
    return true;
}

void buf_consume(struct buf *b, size_t length) {
    if (length > b->length)
        length = b->length;
    if (!b->data)
        return;
    memmove(b->data, b->data + length, b->length - length + 1);
    b->length -= length;
}

const char *buf_text(const struct buf *b) { return b->data ? b->data : ""; }

char *buf_detach(struct buf *b) {
    char *text = b->data ? b->data : mem_strdup("");
    *b = (struct buf){.limit = b->limit};
    return text;
}
