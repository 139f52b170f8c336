/* table.h -- rows of text in aligned columns, for people. */
#ifndef UNBAKE_CLIENT_TABLE_H
#define UNBAKE_CLIENT_TABLE_H

#include <stddef.h>

#include "client/terminal.h"

#define TABLE_COLUMNS 10 /* at most */

struct table {
    size_t columns;
    bool right[TABLE_COLUMNS];    /* align to the right */
    bool optional[TABLE_COLUMNS]; /* omitted if no row has a value */
    char **cell;                  /* [rows][columns]; owned */
    enum colour *colour;          /* [rows][columns] */
    size_t rows, capacity;
};

/* `headings` are the first row. A heading that begins with '>' is right-aligned; one that begins with '?' is omitted
 * while its column is empty (not the last). */
void table_init(struct table *t, size_t columns, const char *const *headings);
void table_release(struct table *t);
/* Starts a row of empty cells. */
void table_row(struct table *t);
/* Sets a cell of the last row; control characters are removed. */
void table_set(struct table *t, size_t column, enum colour colour, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
/* Prints the table. On a terminal the last column is cut at the edge. */
void table_print(const struct table *t, struct terminal *terminal);

#endif
