/* template.c -- see template.h. */
#include "server/executor/template.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "common/mem.h"

#define LETTERS "abcdefghijklmnopqrstuvwxyz_"
#define BLANKS " \t\r\n"

/* --- words --------------------------------------------------------------------------------- */

void words_free(char **words) {
    for (size_t i = 0; words && words[i]; i++)
        mem_free(words[i]);
    mem_free(words);
}

/* One word from *at on; advances *at. NULL: a quotation mark is missing. */
static char *next_word(const char **at) {
    struct buf word;
    bool is_quoted = false;
    buf_init(&word, 1 << 20);
    while (**at && (is_quoted || !strchr(BLANKS, **at))) {
        bool is_escaped = (*at)[0] == '\\' && (*at)[1] == '"';
        *at += is_escaped;
        if (**at == '"' && !is_escaped)
            is_quoted = !is_quoted;
        else
            buf_append(&word, *at, 1);
        ++*at;
    }
    char *text = is_quoted ? NULL : mem_strdup(buf_text(&word));
    buf_release(&word);
    return text;
}

enum status words_parse(const char *text, char ***words, struct error *err) {
    size_t count = 0;
    char **list = mem_calloc(1, sizeof *list);
    const char *at = text + strspn(text, BLANKS);
    enum status status = *at ? STATUS_OK : error_set(err, STATUS_INPUT, "has no word");
    while (*at && status == STATUS_OK) {
        char *word = next_word(&at);
        if (!word)
            status = error_set(err, STATUS_INPUT, "has a quotation mark without its partner");
        list = mem_realloc_array(list, count + 2, sizeof *list);
        list[count++] = word;
        list[count] = NULL;
        at += strspn(at, BLANKS);
    }
    if (status != STATUS_OK)
        words_free(list);
    *words = status == STATUS_OK ? list : NULL;
    return status;
}

/* --- placeholders -------------------------------------------------------------------------- */

/* Length of the placeholder that `at` begins with, with its braces; 0: none. */
static size_t placeholder_length(const char *at) {
    if (*at != '{')
        return 0;
    size_t letters = strspn(at + 1, LETTERS);
    return letters > 0 && at[1 + letters] == '}' ? letters + 2 : 0;
}

static const struct placeholder *find(const struct placeholder *known, size_t count, const char *at, size_t length) {
    for (size_t i = 0; i < count; i++)
        if (strlen(known[i].name) == length - 2 && strncmp(known[i].name, at + 1, length - 2) == 0)
            return &known[i];
    return NULL;
}

enum status template_check(const char *text, const struct placeholder *known, size_t count, struct error *err) {
    for (const char *at = text; *at; at++) {
        size_t length = placeholder_length(at);
        if (at[0] == '{' && at[1] == '{')
            at++;
        else if (length > 0 && !find(known, count, at, length))
            return error_set(err, STATUS_INPUT, "has an unknown placeholder %.*s", (int)(length < 64 ? length : 64),
                             at);
    }
    return STATUS_OK;
}

void template_fill(const char *text, const struct placeholder *known, size_t count, struct buf *to) {
    for (const char *at = text; *at; at++) {
        size_t length = placeholder_length(at);
        const struct placeholder *p = length > 0 ? find(known, count, at, length) : NULL;
        if (at[0] == '{' && at[1] == '{') {
            buf_append(to, at, 2);
            at++;
        } else if (p) {
            buf_puts(to, p->value);
            at += length - 1;
        } else {
            buf_append(to, at, 1);
        }
    }
}

/* --- lines --------------------------------------------------------------------------------- */

static const char *const part_names[] = {"id", "name", "state", "reason", "_"};

/* Where the part {name} goes, and how much fits; false: it is unknown. */
static bool find_part(const char *at, size_t length, struct line_parts *parts, char **to, size_t *size) {
    char *const places[] = {parts->id, parts->name, parts->state, parts->reason, NULL};
    const size_t sizes[] = {sizeof parts->id, sizeof parts->name, sizeof parts->state, sizeof parts->reason, 0};
    for (size_t i = 0; i < sizeof part_names / sizeof *part_names; i++) {
        if (strlen(part_names[i]) == length - 2 && strncmp(part_names[i], at + 1, length - 2) == 0) {
            *to = places[i];
            *size = sizes[i];
            return true;
        }
    }
    return false;
}

enum status pattern_check(const char *pattern, struct error *err) {
    struct line_parts none;
    char *to;
    size_t size, length = 0;
    for (const char *at = pattern; *at; at += length ? length : 1) {
        bool follows = length > 0;
        length = placeholder_length(at);
        if (length > 0 && !find_part(at, length, &none, &to, &size))
            return error_set(err, STATUS_INPUT, "has an unknown placeholder %.*s", (int)(length < 64 ? length : 64),
                             at);
        if (length > 0 && follows)
            return error_set(err, STATUS_INPUT, "has two placeholders with nothing between them");
    }
    return STATUS_OK;
}

static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

/* End of the part that begins at `at`, before what follows it in the pattern. */
static const char *part_end(const char *at, const char *end, char next) {
    if (next == '\0')
        while (end > at && is_blank(end[-1]))
            end--;
    for (const char *c = at; c < end && next; c++)
        if (is_blank(next) ? is_blank(*c) : *c == next)
            return c;
    return end;
}

bool pattern_match(const char *pattern, const char *line, size_t length, struct line_parts *parts) {
    const char *end = line + length;
    memset(parts, 0, sizeof *parts);
    while (line < end && is_blank(*line) && !is_blank(*pattern))
        line++;
    for (const char *p = pattern; *p;) {
        size_t part = placeholder_length(p), size = 0;
        char *to = NULL;
        if (part > 0 && find_part(p, part, parts, &to, &size)) {
            const char *stop = part_end(line, end, p[part]);
            /* only a reason may be missing */
            if (stop == line && to != parts->reason)
                return false;
            if (to)
                snprintf(to, size, "%.*s", (int)(stop - line), line);
            line = stop;
            p += part;
        } else if (is_blank(*p)) {
            if (line == end || !is_blank(*line))
                return false;
            while (line < end && is_blank(*line))
                line++;
            p++;
        } else if (line == end || *line++ != *p++) {
            return false;
        }
    }
    return true;
}
