/* terminal.c -- see terminal.h. */
#include "client/terminal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "common/utf8.h"

static bool locale_is_utf8(void) {
    static const char *const names[] = {"LC_ALL", "LC_CTYPE", "LANG"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        const char *value = getenv(names[i]);
        if (value && *value)
            return strcasestr(value, "utf-8") != NULL || strcasestr(value, "utf8") != NULL;
    }
    return false;
}

void terminal_init(struct terminal *t, FILE *out) {
    const char *kind = getenv("TERM"), *no_colour = getenv("NO_COLOR");
    bool live = isatty(fileno(out)) && kind && *kind && strcmp(kind, "dumb") != 0;
    *t = (struct terminal){
        .out = out,
        .live = live,
        .colour = live && !(no_colour && *no_colour),
        .unicode = locale_is_utf8(),
    };
}

size_t terminal_width(const struct terminal *t) {
    struct winsize size;
    if (ioctl(fileno(t->out), TIOCGWINSZ, &size) == 0 && size.ws_col > 0)
        return size.ws_col;
    const char *columns = getenv("COLUMNS");
    long value = columns ? strtol(columns, NULL, 10) : 0;
    return value > 0 && value < 10000 ? (size_t)value : 80;
}

void terminal_draw(struct terminal *t, const char *text) {
    if (!t->live)
        return;
    struct buf line;
    buf_init(&line, 4096);
    buf_puts(&line, text);
    text_cut(&line, terminal_width(t) - 1); /* a full line would wrap on some terminals */
    fprintf(t->out, "\r%s\033[K", buf_text(&line));
    fflush(t->out);
    t->open = true;
    buf_release(&line);
}

void terminal_clear(struct terminal *t) {
    if (!t->open)
        return;
    fputs("\r\033[K", t->out);
    fflush(t->out);
    t->open = false;
}

void terminal_keep(struct terminal *t) {
    if (!t->open)
        return;
    fputc('\n', t->out);
    fflush(t->out);
    t->open = false;
}

const char *terminal_colour(const struct terminal *t, enum colour colour) {
    static const char *const sequence[] = {"\033[0m", "\033[31m", "\033[32m", "\033[33m", "\033[2m"};
    return t->colour ? sequence[colour] : "";
}

/* Length of the well-formed UTF-8 sequence at `at`; 0 when there is none. */
static size_t utf8_length(const char *at) {
    unsigned char first = (unsigned char)at[0];
    size_t length = first < 0x80 ? 1 : first < 0xC2 ? 0 : first < 0xE0 ? 2 : first < 0xF0 ? 3 : 4;
    if (first > 0xF4)
        return 0;
    for (size_t i = 1; i < length; i++)
        if (((unsigned char)at[i] & 0xC0) != 0x80)
            return 0;
    return length;
}

void terminal_clean(struct buf *out, const char *text) {
    char shown[UTF8_SHOWN_SIZE];
    for (size_t left = strlen(text), size; left > 0; text += size, left -= size) {
        size = utf8_show(text, left, shown);
        buf_puts(out, shown);
    }
}

/* Length of the escape sequence (ESC [ ... letter) at `at`; 0 when there is none. */
static size_t escape_length(const char *at) {
    if (at[0] != '\033' || at[1] != '[')
        return 0;
    size_t length = 2 + strspn(at + 2, "0123456789;");
    return at[length] ? length + 1 : 0;
}

size_t text_columns(const char *text) {
    size_t columns = 0;
    while (*text) {
        size_t escape = escape_length(text), length = utf8_length(text);
        columns += escape ? 0 : 1;
        text += escape ? escape : length ? length : 1;
    }
    return columns;
}

void text_cut(struct buf *b, size_t columns) {
    size_t kept = 0, read = 0, used = 0;
    while (read < b->length) {
        size_t escape = escape_length(b->data + read), length = utf8_length(b->data + read);
        size_t step = escape ? escape : length ? length : 1;
        if (escape || used < columns) {
            memmove(b->data + kept, b->data + read, step);
            kept += step;
        }
        used += escape ? 0 : 1;
        read += step;
    }
    if (b->data)
        b->data[kept] = '\0';
    b->length = kept;
}

void format_bytes(char out[16], double bytes) {
    static const char *const unit[] = {"B", "KiB", "MiB", "GiB", "TiB", "PiB", "EiB"};
    size_t i = 0;
    if (!(bytes > 0.0))
        bytes = 0.0;
    /* 1023.95 would print as 1024.0. */
    while (bytes >= (i == 0 ? 1000.0 : 1023.95) && i + 1 < sizeof unit / sizeof *unit) {
        bytes /= 1024.0;
        i++;
    }
    snprintf(out, 16, i == 0 ? "%.0f %s" : "%.1f %s", fmin(bytes, 99999.0), unit[i]);
}

void format_duration(char out[16], double seconds) {
    if (!(seconds >= 0.0 && seconds <= 1e9)) {
        snprintf(out, 16, "--");
        return;
    }
    unsigned s = (unsigned)lround(seconds);
    if (s < 60)
        snprintf(out, 16, "%us", s);
    else if (s < 3600)
        snprintf(out, 16, "%um%02us", s / 60, s % 60);
    else if (s < 86400)
        snprintf(out, 16, "%uh%02um", s / 3600, s / 60 % 60);
    else
        snprintf(out, 16, "%ud%02uh", s / 86400 % 100000, s / 3600 % 24);
}

void format_bar(struct buf *out, size_t columns, double fraction, bool unicode) {
    /* Eighths of a block, U+258F (one) to U+2588 (eight). */
    static const char *const part[] = {" ",
                                       "\xE2\x96\x8F",
                                       "\xE2\x96\x8E",
                                       "\xE2\x96\x8D",
                                       "\xE2\x96\x8C",
                                       "\xE2\x96\x8B",
                                       "\xE2\x96\x8A",
                                       "\xE2\x96\x89",
                                       "\xE2\x96\x88"};
    if (columns < 3)
        return;
    size_t cells = columns - 2, steps = unicode ? 8 : 1;
    double clamped = fraction > 0.0 ? fmin(fraction, 1.0) : 0.0;
    size_t filled = (size_t)(clamped * (double)(cells * steps) + 1e-9);
    buf_puts(out, "[");
    for (size_t i = 0; i < cells; i++) {
        size_t here = filled > i * steps ? filled - i * steps : 0;
        if (unicode)
            buf_puts(out, part[here < 8 ? here : 8]);
        else
            buf_puts(out, here ? "#" : "-");
    }
    buf_puts(out, "]");
}

void format_figure(char out[24], double value) {
    double size = fabs(value);
    if (!isfinite(value) || value == 0.0 || size < 1e-4 || size >= 1e6) {
        snprintf(out, 24, "%.3g", value);
        return;
    }
    int before = (int)floor(log10(size));
    int decimals = before >= 3 ? 0 : 3 - before;
    snprintf(out, 24, "%.*f", decimals, value);
}
