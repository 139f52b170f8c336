/* table.c -- see table.h. */
#include "client/table.h"

#include <assert.h>
#include <stdarg.h>
#include <string.h>

#include "common/mem.h"

#define CELL_MAX 4096

void table_init(struct table *t, size_t columns, const char *const *headings) {
    assert(columns <= TABLE_COLUMNS);
    *t = (struct table){.columns = columns};
    table_row(t);
    for (size_t i = 0; i < columns; i++) {
        t->right[i] = headings[i][0] == '>';
        t->optional[i] = headings[i][0] == '?';
        table_set(t, i, COLOUR_DIM, "%s", headings[i] + (t->right[i] || t->optional[i]));
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

static void print_row(const struct table *t, size_t row, const size_t *width, struct terminal *terminal) {
    size_t used = 0, edge = terminal->live ? terminal_width(terminal) : 0;
    for (size_t i = 0; i < t->columns; i++) {
        if (width[i] == 0)
            continue;
        struct buf cell;
        buf_init(&cell, CELL_MAX);
        buf_puts(&cell, t->cell[row * t->columns + i]);
        bool last = i + 1 == t->columns;
        if (last && edge > used + 8)
            text_cut(&cell, edge - used);
        size_t columns = text_columns(buf_text(&cell));
        size_t pad = columns < width[i] ? width[i] - columns : 0;
        enum colour colour = t->colour[row * t->columns + i];
        if (t->right[i])
            put_spaces(terminal->out, pad);
        const char *on = colour ? terminal_colour(terminal, colour) : "";
        const char *off = colour ? terminal_colour(terminal, COLOUR_NONE) : "";
        fprintf(terminal->out, "%s%s%s", on, buf_text(&cell), off);
        if (!t->right[i] && !last)
            put_spaces(terminal->out, pad);
        fputs(last ? "\n" : "  ", terminal->out);
        used += width[i] + 2;
        buf_release(&cell);
    }
}

void table_print(const struct table *t, struct terminal *terminal) {
    size_t width[TABLE_COLUMNS] = {0};
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
    for (size_t row = 0; row < t->rows; row++)
        print_row(t, row, width, terminal);
}
