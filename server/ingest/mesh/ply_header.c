/* ply_header.c -- see ply_header.h. The format is Turk's, "The PLY Polygon File Format" (1994),
 * with the type names (int8, float32...) that later writers added. */
#include "server/ingest/mesh/ply_header.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "server/ingest/mesh/positions.h"

#define MAX_HEADER ((size_t)1 << 20) /* bytes */

static const struct {
    const char *name, *alias;
    uint8_t bytes;
} type_table[] = {
    [PLY_INT8] = {"char", "int8", 1},        [PLY_UINT8] = {"uchar", "uint8", 1},
    [PLY_INT16] = {"short", "int16", 2},     [PLY_UINT16] = {"ushort", "uint16", 2},
    [PLY_INT32] = {"int", "int32", 4},       [PLY_UINT32] = {"uint", "uint32", 4},
    [PLY_FLOAT32] = {"float", "float32", 4}, [PLY_FLOAT64] = {"double", "float64", 8},
};

struct parser {
    struct ply_cursor *cursor;
    struct ply_header *header;
    struct error *err;
};

bool ply_next_line(struct ply_cursor *c, const uint8_t **line, size_t *length) {
    if (c->at >= c->size)
        return false;
    const uint8_t *start = c->data + c->at;
    const uint8_t *end = memchr(start, c->newline, c->size - c->at);
    size_t taken = end ? (size_t)(end - start) : c->size - c->at;
    c->line_end = c->at + taken;
    c->at += taken + (end ? 1 : 0);
    c->line++;
    *line = start;
    *length = taken > 0 && start[taken - 1] == '\r' ? taken - 1 : taken;
    return true;
}

size_t ply_type_bytes(enum ply_type type) { return type_table[type].bytes; }

const struct ply_element *ply_find_element(const struct ply_header *header, const char *name) {
    for (size_t i = 0; i < header->element_count; i++)
        if (strcasecmp(header->element[i].name, name) == 0)
            return &header->element[i];
    return NULL;
}

size_t ply_find_property(const struct ply_header *header, const struct ply_element *e, const char *name) {
    size_t found = SIZE_MAX;
    for (size_t i = 0; i < e->property_count; i++) {
        const char *own = header->property[e->first + i].name;
        if (strcmp(own, name) == 0)
            return i;
        if (found == SIZE_MAX && strcasecmp(own, name) == 0)
            found = i;
    }
    return found;
}

static bool parse_type(const char *word, enum ply_type *type) {
    for (size_t i = 0; i < sizeof type_table / sizeof *type_table; i++) {
        if (strcasecmp(word, type_table[i].name) == 0 || strcasecmp(word, type_table[i].alias) == 0) {
            *type = (enum ply_type)i;
            return true;
        }
    }
    return false;
}

static enum status header_error(struct parser *p, const char *what, const char *word) {
    return error_set(p->err, STATUS_INPUT, "%s, line %zu: %s%s%s%s", p->cursor->name, p->cursor->line, what,
                     word ? " \"" : "", word ? word : "", word ? "\"" : "");
}

static enum status parse_element(struct parser *p, char *const *word, size_t words) {
    if (words != 3)
        return header_error(p, "expected \"element NAME COUNT\"", NULL);
    if (p->header->element_count == PLY_MAX_ELEMENTS)
        return header_error(p, "too many elements", NULL);
    char *end;
    errno = 0;
    unsigned long long count = strtoull(word[2], &end, 10);
    if (word[2][0] < '0' || word[2][0] > '9' || *end != '\0' || errno != 0)
        return header_error(p, "expected a count, found", word[2]);
    struct ply_element *e = &p->header->element[p->header->element_count++];
    memcpy(e->name, word[1], strlen(word[1]) + 1);
    e->count = count;
    e->first = p->header->property_count;
    e->property_count = 0;
    return STATUS_OK;
}

static enum status parse_property(struct parser *p, char *const *word, size_t words) {
    bool is_list = words >= 2 && strcmp(word[1], "list") == 0;
    if (words != (is_list ? 5 : 3))
        return header_error(p,
                            "expected \"property TYPE NAME\" or \"property list COUNT_TYPE "
                            "TYPE NAME\"",
                            NULL);
    if (p->header->element_count == 0)
        return header_error(p, "a property before the first element", NULL);
    if (p->header->property_count == PLY_MAX_PROPERTIES)
        return header_error(p, "too many properties", NULL);
    struct ply_property *property = &p->header->property[p->header->property_count++];
    p->header->element[p->header->element_count - 1].property_count++;
    property->is_list = is_list;
    if (!parse_type(word[is_list ? 3 : 1], &property->type))
        return header_error(p, "unknown type", word[is_list ? 3 : 1]);
    if (is_list && (!parse_type(word[2], &property->count_type) || property->count_type >= PLY_FLOAT32))
        return header_error(p, "the length of a list must have an integer type, found", word[2]);
    memcpy(property->name, word[words - 1], strlen(word[words - 1]) + 1);
    return STATUS_OK;
}

static enum status parse_format(struct parser *p, char *const *word, size_t words) {
    static const char *const names[] = {
        [PLY_ASCII] = "ascii",
        [PLY_LITTLE_ENDIAN] = "binary_little_endian",
        [PLY_BIG_ENDIAN] = "binary_big_endian",
    };
    for (enum ply_format f = PLY_ASCII; words >= 2 && f <= PLY_BIG_ENDIAN; f++) {
        if (strcmp(word[1], names[f]) == 0) {
            p->header->format = f;
            return STATUS_OK;
        }
    }
    return header_error(p, "unknown format", words >= 2 ? word[1] : "");
}

/* Splits at blanks into NUL-terminated words in `copy`, storing the first 6 and counting all. False when a stored
 * word is too long for a name. */
static bool split_words(char *copy, char **word, size_t *words) {
    *words = 0;
    char *rest = copy;
    for (char *w; (w = strtok_r(rest, " \t", &rest)) != NULL;) {
        if (*words < 6 && strlen(w) >= PLY_MAX_NAME)
            return false;
        if (*words < 6)
            word[*words] = w;
        (*words)++;
    }
    return true;
}

static void parse_comment(struct parser *p, const uint8_t *text, size_t length) {
    char copy[128];
    if (length >= sizeof copy)
        return;
    memcpy(copy, text, length);
    copy[length] = '\0';
    positions_read_offset(copy, p->header->offset);
    const char *word = copy + strspn(copy, " \t");
    p->header->picture_count += strncmp(word, "TextureFile ", 12) == 0;
}

static enum status parse_header_line(struct parser *p, const uint8_t *line, size_t length, bool *done) {
    static const char *const ignored[] = {"comment", "obj_info"};
    for (size_t i = 0; i < 2; i++) {
        size_t n = strlen(ignored[i]);
        if (length < n || memcmp(line, ignored[i], n) != 0 || (length > n && line[n] != ' ' && line[n] != '\t'))
            continue;
        parse_comment(p, line + n, length - n);
        return STATUS_OK;
    }
    char copy[512], *word[6];
    size_t words;
    if (length >= sizeof copy)
        return header_error(p, "the line is too long for a PLY header", NULL);
    memcpy(copy, line, length);
    copy[length] = '\0';
    if (strlen(copy) != length || !split_words(copy, word, &words))
        return header_error(p, "this is not a line of a PLY header", NULL);
    if (words == 0)
        return STATUS_OK;
    if (strcmp(word[0], "format") == 0)
        return parse_format(p, word, words);
    if (strcmp(word[0], "element") == 0)
        return parse_element(p, word, words);
    if (strcmp(word[0], "property") == 0)
        return parse_property(p, word, words);
    if (strcmp(word[0], "end_header") != 0)
        return header_error(p, "unknown keyword", word[0]);
    *done = true;
    return STATUS_OK;
}

enum status ply_header_parse(struct ply_cursor *c, struct ply_header *header, struct error *err) {
    struct parser p = {c, header, err};
    *header = (struct ply_header){.format = PLY_UNKNOWN};
    if (c->size < 4 || memcmp(c->data, "ply", 3) != 0 || !strchr("\r\n \t", c->data[3]))
        return error_set(err, STATUS_INPUT, "%s is not a PLY file: it does not begin with \"ply\"", c->name);
    const uint8_t *line;
    size_t length;
    c->at = c->line = 0;
    c->newline = c->data[3] == '\r' && c->size > 4 && c->data[4] != '\n' ? '\r' : '\n';
    ply_next_line(c, &line, &length);
    for (bool done = false; !done;) {
        if (c->at > MAX_HEADER || !ply_next_line(c, &line, &length))
            return error_set(err, STATUS_INPUT, "%s: the header ends at line %zu without \"end_header\"", c->name,
                             c->line);
        enum status status = parse_header_line(&p, line, length, &done);
        if (status != STATUS_OK)
            return status;
    }
    if (header->format == PLY_UNKNOWN)
        return error_set(err, STATUS_INPUT, "%s: the header has no \"format\" line", c->name);
    return STATUS_OK;
}
