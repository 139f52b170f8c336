/* table.c -- see table.h. */
#include "client/table.h"

#include <assert.h>
#include <stdarg.h>
#include <string.h>

#include "common/mem.h"

#define CELL_MAX 4096  /* bytes of a cell; what is longer is cut off */
#define LAST_WANTED 16 /* columns: of a name in a list this much tells it from others */
#define LAST_MIN 8     /* columns: less is not worth a column */

void table_init(struct table *t, size_t columns, const char *const *headings) {
    assert(columns <= TABLE_COLUMNS);
    *t = (struct table){.columns = columns};
    table_row(t);
    for (size_t i = 0; i < columns; i++) {
        const char *heading = headings[i];
        for (; *heading && strchr(">?~|", *heading); heading++) {
            t->right[i] = t->right[i] || *heading == '>';
            t->optional[i] = t->optional[i] || *heading == '?';
            t->lesser[i] = t->lesser[i] || *heading == '~';
            t->wraps = t->wraps || *heading == '|';
        }
        table_set(t, i, COLOUR_DIM, "%s", heading);
    }
}

void table_release(struct table *t) {
    for (size_t i = 0; i < t->rows * t->columns; i++)
        mem_free(t->cell[i]);
    mem_free(t->cell);
    mem_free(t->colour);
    *t = (struct table){0};
}

void table_row(struct table *t) {
    if (t->rows == t->capacity) {
        t->capacity = t->capacity ? 2 * t->capacity : 32;
        t->cell = mem_realloc_array(t->cell, t->capacity * t->columns, sizeof *t->cell);
        t->colour = mem_realloc_array(t->colour, t->capacity * t->columns, sizeof *t->colour);
    }
    for (size_t i = 0; i < t->columns; i++) {
        t->cell[t->rows * t->columns + i] = mem_strdup("");
        t->colour[t->rows * t->columns + i] = COLOUR_NONE;
    }
    t->rows++;
}

void table_set(struct table *t, size_t column, enum colour colour, const char *format, ...) {
    struct buf clean;
    char text[CELL_MAX];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    buf_init(&clean, CELL_MAX);
    terminal_clean(&clean, text);
    size_t at = (t->rows - 1) * t->columns + column;
    mem_free(t->cell[at]);
    t->cell[at] = buf_detach(&clean);
    t->colour[at] = colour;
}

static void put_spaces(FILE *out, size_t count) { fprintf(out, "%*s", (int)count, ""); }

/* Prints the last cell between column `from` and the edge (0: none), broken at blanks where the table wraps. */
static void print_last(const struct table *t, const char *text, size_t from, size_t edge, struct terminal *terminal) {
    size_t room = edge > from + LAST_MIN ? edge - from : edge ? LAST_MIN : CELL_MAX;
    while (t->wraps && strlen(text) > room) { /* no fewer bytes than columns */
        size_t length = room;
        while (length > 0 && text[length] != ' ')
            length--;
        if (length == 0)
            break;
        fprintf(terminal->out, "%.*s\n", (int)length, text);
        put_spaces(terminal->out, from);
        text += length + 1;
    }
    struct buf cell;
    buf_init(&cell, CELL_MAX);
    buf_puts(&cell, text);
    text_cut(&cell, room);
    fputs(buf_text(&cell), terminal->out);
    buf_release(&cell);
}

static void print_row(const struct table *t, size_t row, const size_t *width, size_t edge, struct terminal *terminal) {
    size_t used = 0;
    for (size_t i = 0; i < t->columns; i++) {
        if (width[i] == 0)
            continue;
        const char *text = t->cell[row * t->columns + i];
        bool last = i + 1 == t->columns;
        size_t columns = text_columns(text), pad = columns < width[i] ? width[i] - columns : 0;
        enum colour colour = t->colour[row * t->columns + i];
        if (t->right[i])
            put_spaces(terminal->out, pad);
        fputs(colour ? terminal_colour(terminal, colour) : "", terminal->out);
        if (last)
            print_last(t, text, used, edge, terminal);
        else
            fputs(text, terminal->out);
        fputs(colour ? terminal_colour(terminal, COLOUR_NONE) : "", terminal->out);
        if (!t->right[i] && !last)
            put_spaces(terminal->out, pad);
        fputs(last ? "\n" : "  ", terminal->out);
        used += width[i] + 2;
    }
}

/* Omits lesser columns until a last column of a readable width fits before the edge. */
static void make_room(const struct table *t, size_t *width, size_t edge) {
    size_t last = t->columns - 1, wanted = width[last] < LAST_WANTED ? width[last] : LAST_WANTED;
    for (size_t i = t->columns; i-- > 0;) {
        size_t used = wanted;
        for (size_t j = 0; j < last; j++)
            used += width[j] ? width[j] + 2 : 0;
        if (used <= edge)
            return;
        if (t->lesser[i])
            width[i] = 0;
    }
}

void table_print(const struct table *t, struct terminal *terminal) {
    size_t width[TABLE_COLUMNS] = {0}, edge = terminal->live ? terminal_width(terminal) : 0;
    for (size_t i = t->columns; i < t->rows * t->columns; i++) {
        size_t columns = text_columns(t->cell[i]);
        if (columns > width[i % t->columns])
            width[i % t->columns] = columns;
    }
    for (size_t i = 0; i < t->columns; i++) {
        size_t columns = text_columns(t->cell[i]);
        if (columns > width[i] && !(t->optional[i] && width[i] == 0))
            width[i] = columns;
    }
    if (edge)
        make_room(t, width, edge);
    for (size_t row = 0; row < t->rows; row++)
        print_row(t, row, width, edge, terminal);
}
