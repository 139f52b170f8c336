/* colmap_cursor.h -- reads a COLMAP file as bytes (.bin, little-endian) or as lines of words (.txt). */
#ifndef UNBAKE_INGEST_SOURCE_COLMAP_CURSOR_H
#define UNBAKE_INGEST_SOURCE_COLMAP_CURSOR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"

#define COLMAP_MAX_TOKEN 256 /* bytes of a word with its NUL; longer ones are truncated */

struct colmap_cursor {
    const char *name;    /* for messages */
    const uint8_t *data; /* [size] borrowed */
    size_t size, at;
    size_t line_end;   /* of the present line; `at` is within it */
    size_t line;       /* its number, from 1; 0: before the first */
    struct error *err; /* receives error messages */
};

/* Read an unsigned integer of `bytes` bytes, or doubles; false at the end of the file. */
bool colmap_take_whole(struct colmap_cursor *r, size_t bytes, uint64_t *value);
bool colmap_take_doubles(struct colmap_cursor *r, size_t count, double *value);
/* The error for that; STATUS_INPUT. */
enum status colmap_cut_off(const struct colmap_cursor *r);

/* Moves to the next line; to the next that is neither empty nor a comment. False at the end of the file. */
bool colmap_next_line(struct colmap_cursor *r);
bool colmap_next_record(struct colmap_cursor *r);
/* The next word of the line; false at its end. */
bool colmap_next_token(struct colmap_cursor *r, char token[COLMAP_MAX_TOKEN]);
/* Read words as numbers or as an id; STATUS_INPUT when they are not. */
enum status colmap_read_doubles(struct colmap_cursor *r, size_t count, double *value);
enum status colmap_read_id(struct colmap_cursor *r, uint64_t *id);
/* "NAME, line N: what"; STATUS_INPUT. */
enum status colmap_line_error(const struct colmap_cursor *r, const char *what);

#endif
