/* table.h -- rows of text in aligned columns, for people. */
#ifndef UNBAKE_CLIENT_TABLE_H
#define UNBAKE_CLIENT_TABLE_H

#include <stddef.h>

#include "client/terminal.h"

#define TABLE_COLUMNS 24 /* at most */

struct table {
    size_t columns;
    bool right[TABLE_COLUMNS];    /* align to the right */
    bool optional[TABLE_COLUMNS]; /* omitted if no row has a value */
    bool lesser[TABLE_COLUMNS];   /* omitted where the terminal is too narrow for all */
    bool wraps;                   /* on a terminal the last column goes on below itself */
    char **cell;                  /* [rows][columns]; owned */
    enum colour *colour;          /* [rows][columns] */
    size_t rows, capacity;
};

/* `headings` are the first row. Marks before a heading: '>' its column is right-aligned; '?' it is omitted while it is
 * empty (not the last); '~' it is omitted where the terminal is too narrow, the last such column first (not the last);
 * '|' (the last) it goes on below itself. */
void table_init(struct table *t, size_t columns, const char *const *headings);
void table_release(struct table *t);
/* Starts a row of empty cells. */
void table_row(struct table *t);
/* Sets a cell of the last row; control characters are removed. */
void table_set(struct table *t, size_t column, enum colour colour, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
/* Prints the table. On a terminal no line is longer than the terminal is wide, as far as that can be had by omitting
 * columns and cutting the last; elsewhere all is printed, for other programs. */
void table_print(const struct table *t, struct terminal *terminal);

#endif
