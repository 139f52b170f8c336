/* terminal.h -- output for people: lines redrawn in place, colour, short forms of numbers. A terminal is "live" when
 * its stream can redraw a line; on a pipe, a file or TERM=dumb nothing is redrawn and no escape sequence is written.
 * Colour also needs NO_COLOR to be unset or empty (no-color.org). */
#ifndef UNBAKE_CLIENT_TERMINAL_H
#define UNBAKE_CLIENT_TERMINAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "common/buf.h"

enum colour { COLOUR_NONE, COLOUR_RED, COLOUR_GREEN, COLOUR_YELLOW, COLOUR_DIM };

struct terminal {
    FILE *out;
    bool live, colour, unicode;
    bool open; /* a redrawn line is on the screen */
};

void terminal_init(struct terminal *t, FILE *out);
size_t terminal_width(const struct terminal *t); /* columns; 80 if unknown */

/* Draws `text`, cut to the width, over the previous drawn line. Does nothing unless live. */
void terminal_draw(struct terminal *t, const char *text);
/* Clears the drawn line, so that ordinary output can follow. */
void terminal_clear(struct terminal *t);
/* Keeps the drawn line, and goes to the next. */
void terminal_keep(struct terminal *t);
/* The escape sequences around coloured text; "" where there is no colour. */
const char *terminal_colour(const struct terminal *t, enum colour colour);

/* Appends text of foreign origin (a file name, a log line) through utf8_show, so that it can neither control the
 * terminal nor change how the text beside it reads. */
void terminal_clean(struct buf *out, const char *text);

/* Columns that UTF-8 text takes, one a character; escape sequences take none. */
size_t text_columns(const char *text);
/* Cuts *b to at most `columns` columns, at a character's boundary, keeping escape sequences. */
void text_cut(struct buf *b, size_t columns);

/* "999 B", "1.5 KiB", "2.0 GiB". */
void format_bytes(char out[16], double bytes);
/* "7s", "3m05s", "2h07m", "3d04h"; "--" for a negative or non-finite time. */
void format_duration(char out[16], double seconds);
/* Appends "[#####-----]" of `columns` columns in all; fraction is clamped, NaN is 0. */
void format_bar(struct buf *out, size_t columns, double fraction, bool unicode);
/* 4 significant digits, never an exponent for 1e-4 to 1e6: "0.01234", "27.31", "3.2e-07". */
void format_figure(char out[24], double value);

#endif
