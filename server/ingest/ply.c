/* ply.c -- see ply.h. The format is Turk's, "The PLY Polygon File Format" (1994), with the type
 * names (int8, float32...) that later writers added.
 *
 * The file is read in place. Memory is asked for only after the header's promises were held
 * against the bytes that are there, so a lying header costs nothing. An ASCII record is one
 * line; further values on it are ignored, missing ones are an error. */
#include "server/ingest/ply.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/mem.h"
#include "server/ingest/polygon.h"

#define MAX_ELEMENTS 32
#define MAX_PROPERTIES 256 /* of all elements together */
#define MAX_NAME 64
#define MAX_TOKEN 64       /* characters of a number */
#define MAX_HEADER ((size_t)1 << 20)

enum type { INT8, UINT8, INT16, UINT16, INT32, UINT32, FLOAT32, FLOAT64 };

static const struct {
    const char *name, *alias;
    uint8_t bytes;
} type_table[] = {
    [INT8] = {"char", "int8", 1},       [UINT8] = {"uchar", "uint8", 1},
    [INT16] = {"short", "int16", 2},    [UINT16] = {"ushort", "uint16", 2},
    [INT32] = {"int", "int32", 4},      [UINT32] = {"uint", "uint32", 4},
    [FLOAT32] = {"float", "float32", 4}, [FLOAT64] = {"double", "float64", 8},
};

struct property {
    char name[MAX_NAME];
    bool is_list;
    enum type count_type; /* lists only */
    enum type type;
};

struct element {
    char name[MAX_NAME];
    uint64_t count;
    size_t first, property_count; /* its slice of reader.property */
};

enum format { FORMAT_UNKNOWN, FORMAT_ASCII, FORMAT_LITTLE, FORMAT_BIG };

struct reader {
    const char *name;
    const uint8_t *data;
    size_t size, at;
    enum format format;
    uint8_t newline;         /* '\n', or '\r' in files with old Macintosh lines */
    size_t line, line_end;   /* number of the present line, where it ends */
    const char *element;     /* what is being read, for messages */
    uint64_t record;
    size_t element_count;
    struct element elements[MAX_ELEMENTS];
    size_t property_count;
    struct property property[MAX_PROPERTIES];
    struct error *err;
};

/* --- header ------------------------------------------------------------------------------ */

/* Moves to the next line and gives it without its end; false at the end of the file. */
static bool next_line(struct reader *r, const uint8_t **line, size_t *length) {
    if (r->at >= r->size)
        return false;
    const uint8_t *start = r->data + r->at;
    const uint8_t *end = memchr(start, r->newline, r->size - r->at);
    size_t taken = end ? (size_t)(end - start) : r->size - r->at;
    r->line_end = r->at + taken;
    r->at += taken + (end ? 1 : 0);
    r->line++;
    *line = start;
    *length = taken > 0 && start[taken - 1] == '\r' ? taken - 1 : taken;
    return true;
}

static bool parse_type(const char *word, enum type *type) {
    for (size_t i = 0; i < sizeof type_table / sizeof *type_table; i++) {
        if (strcmp(word, type_table[i].name) == 0 || strcmp(word, type_table[i].alias) == 0) {
            *type = (enum type)i;
            return true;
        }
    }
    return false;
}

static enum status header_error(struct reader *r, const char *what, const char *word) {
    return error_set(r->err, STATUS_INPUT, "%s, line %zu: %s%s%s%s", r->name, r->line, what,
                     word ? " \"" : "", word ? word : "", word ? "\"" : "");
}

static enum status parse_element(struct reader *r, char *const *word, size_t words) {
    if (words != 3)
        return header_error(r, "expected \"element NAME COUNT\"", NULL);
    if (r->element_count == MAX_ELEMENTS)
        return header_error(r, "too many elements", NULL);
    char *end;
    errno = 0;
    unsigned long long count = strtoull(word[2], &end, 10);
    if (word[2][0] < '0' || word[2][0] > '9' || *end != '\0' || errno != 0)
        return header_error(r, "expected a count, found", word[2]);
    struct element *e = &r->elements[r->element_count++];
    memcpy(e->name, word[1], strlen(word[1]) + 1);
    e->count = count;
    e->first = r->property_count;
    e->property_count = 0;
    return STATUS_OK;
}

static enum status parse_property(struct reader *r, char *const *word, size_t words) {
    bool is_list = words >= 2 && strcmp(word[1], "list") == 0;
    if (words != (is_list ? 5 : 3))
        return header_error(r, "expected \"property TYPE NAME\" or \"property list COUNT_TYPE "
                            "TYPE NAME\"", NULL);
    if (r->element_count == 0)
        return header_error(r, "a property before the first element", NULL);
    if (r->property_count == MAX_PROPERTIES)
        return header_error(r, "too many properties", NULL);
    struct property *p = &r->property[r->property_count++];
    r->elements[r->element_count - 1].property_count++;
    p->is_list = is_list;
    if (!parse_type(word[is_list ? 3 : 1], &p->type))
        return header_error(r, "unknown type", word[is_list ? 3 : 1]);
    if (is_list && (!parse_type(word[2], &p->count_type) || p->count_type >= FLOAT32))
        return header_error(r, "the length of a list must have an integer type, found", word[2]);
    memcpy(p->name, word[words - 1], strlen(word[words - 1]) + 1);
    return STATUS_OK;
}

static enum status parse_format(struct reader *r, char *const *word, size_t words) {
    static const char *const names[] = {
        [FORMAT_ASCII] = "ascii",
        [FORMAT_LITTLE] = "binary_little_endian",
        [FORMAT_BIG] = "binary_big_endian",
    };
    for (enum format f = FORMAT_ASCII; words >= 2 && f <= FORMAT_BIG; f++) {
        if (strcmp(word[1], names[f]) == 0) {
            r->format = f;
            return STATUS_OK;
        }
    }
    return header_error(r, "unknown format", words >= 2 ? word[1] : "");
}

/* Splits at blanks into at most 6 NUL-terminated words within `copy`; false when there are more
 * or one is too long for a name. */
static bool split_words(char *copy, char **word, size_t *words) {
    *words = 0;
    char *rest = copy;
    for (char *w; (w = strtok_r(rest, " \t", &rest)) != NULL;) {
        if (*words == 6 || strlen(w) >= MAX_NAME)
            return false;
        word[(*words)++] = w;
    }
    return true;
}

static enum status parse_header_line(struct reader *r, const uint8_t *line, size_t length,
                                     bool *done) {
    static const char *const ignored[] = {"comment", "obj_info"};
    for (size_t i = 0; i < 2; i++) {
        size_t n = strlen(ignored[i]);
        if (length >= n && memcmp(line, ignored[i], n) == 0 &&
            (length == n || line[n] == ' ' || line[n] == '\t'))
            return STATUS_OK;
    }
    char copy[512], *word[6];
    size_t words;
    if (length >= sizeof copy)
        return header_error(r, "the line is too long for a PLY header", NULL);
    memcpy(copy, line, length);
    copy[length] = '\0';
    if (strlen(copy) != length || !split_words(copy, word, &words))
        return header_error(r, "this is not a line of a PLY header", NULL);
    if (words == 0)
        return STATUS_OK;
    if (strcmp(word[0], "format") == 0)
        return parse_format(r, word, words);
    if (strcmp(word[0], "element") == 0)
        return parse_element(r, word, words);
    if (strcmp(word[0], "property") == 0)
        return parse_property(r, word, words);
    if (strcmp(word[0], "end_header") != 0)
        return header_error(r, "unknown keyword", word[0]);
    *done = true;
    return STATUS_OK;
}

static enum status parse_header(struct reader *r) {
    if (r->size < 4 || memcmp(r->data, "ply", 3) != 0 || !strchr("\r\n \t", r->data[3]))
        return error_set(r->err, STATUS_INPUT,
                         "%s is not a PLY file: it does not begin with \"ply\"", r->name);
    const uint8_t *line;
    size_t length;
    r->newline = '\n';
    if (r->data[3] == '\r' && r->size > 4 && r->data[4] != '\n')
        r->newline = '\r';
    next_line(r, &line, &length);
    for (bool done = false; !done;) {
        if (r->at > MAX_HEADER || !next_line(r, &line, &length))
            return error_set(r->err, STATUS_INPUT,
                             "%s: the header ends at line %zu without \"end_header\"", r->name,
                             r->line);
        enum status status = parse_header_line(r, line, length, &done);
        if (status != STATUS_OK)
            return status;
    }
    if (r->format == FORMAT_UNKNOWN)
        return error_set(r->err, STATUS_INPUT, "%s: the header has no \"format\" line", r->name);
    return STATUS_OK;
}

/* --- values ------------------------------------------------------------------------------ */

static enum status value_error(struct reader *r, const char *what) {
    bool ascii = r->format == FORMAT_ASCII;
    return error_set(r->err, STATUS_INPUT, "%s, %s %zu: %s %" PRIu64 " %s", r->name,
                     ascii ? "line" : "byte", ascii ? r->line : r->at, r->element, r->record,
                     what);
}

static uint64_t load(const uint8_t *at, size_t bytes, bool big) {
    uint64_t bits = 0;
    for (size_t i = 0; i < bytes; i++)
        bits |= (uint64_t)at[big ? bytes - 1 - i : i] << (8 * i);
    return bits;
}

static enum status read_binary(struct reader *r, enum type type, double *value) {
    size_t bytes = type_table[type].bytes;
    if (r->size - r->at < bytes)
        return value_error(r, "is cut off: the file ends there");
    uint64_t bits = load(r->data + r->at, bytes, r->format == FORMAT_BIG);
    r->at += bytes;
    float single;
    uint32_t low = (uint32_t)bits;
    switch (type) {
    case INT8: *value = (int8_t)bits; break;
    case INT16: *value = (int16_t)bits; break;
    case INT32: *value = (int32_t)low; break;
    case UINT8:
    case UINT16:
    case UINT32: *value = low; break;
    case FLOAT32:
        memcpy(&single, &low, sizeof single);
        *value = (double)single;
        break;
    case FLOAT64: memcpy(value, &bits, sizeof *value); break;
    }
    return STATUS_OK;
}

static bool is_blank(uint8_t c) {
    return c == ' ' || c == '\t' || c == '\r';
}

static enum status read_ascii(struct reader *r, double *value) {
    while (r->at < r->line_end && is_blank(r->data[r->at]))
        r->at++;
    if (r->at >= r->line_end)
        return value_error(r, "has fewer values than the header says");
    char token[MAX_TOKEN];
    size_t length = 0;
    while (r->at < r->line_end && !is_blank(r->data[r->at])) {
        if (length + 1 == sizeof token)
            return value_error(r, "has a value that is not a number");
        token[length++] = (char)r->data[r->at++];
    }
    token[length] = '\0';
    char *end;
    *value = strtod(token, &end);
    if (end != token + length || strpbrk(token, "xX("))
        return value_error(r, "has a value that is not a number");
    return STATUS_OK;
}

static enum status read_value(struct reader *r, enum type type, double *value) {
    return r->format == FORMAT_ASCII ? read_ascii(r, value) : read_binary(r, type, value);
}

static enum status read_list_count(struct reader *r, const struct property *p, uint64_t *count) {
    double value;
    enum status status = read_value(r, p->count_type, &value);
    if (status != STATUS_OK)
        return status;
    if (!(value >= 0.0 && value <= UINT32_MAX) || value != floor(value))
        return value_error(r, "has a list of impossible length");
    *count = (uint64_t)value;
    return STATUS_OK;
}

static enum status skip_property(struct reader *r, const struct property *p) {
    uint64_t count = 1;
    double ignored;
    if (p->is_list) {
        enum status status = read_list_count(r, p, &count);
        if (status != STATUS_OK)
            return status;
    }
    if (r->format != FORMAT_ASCII) {
        if ((r->size - r->at) / type_table[p->type].bytes < count)
            return value_error(r, "is cut off: the file ends there");
        r->at += (size_t)count * type_table[p->type].bytes;
        return STATUS_OK;
    }
    for (uint64_t i = 0; i < count; i++) {
        enum status status = read_ascii(r, &ignored);
        if (status != STATUS_OK)
            return status;
    }
    return STATUS_OK;
}

/* Goes to the first value of the next record: in ASCII, the next line that is not blank. */
static enum status begin_record(struct reader *r, uint64_t record) {
    r->record = record;
    if (r->format != FORMAT_ASCII)
        return STATUS_OK;
    const uint8_t *line;
    size_t length;
    do {
        if (!next_line(r, &line, &length))
            return value_error(r, "is missing: the file ends there");
        while (length > 0 && is_blank(line[0])) {
            line++;
            length--;
        }
    } while (length == 0);
    r->at = (size_t)(line - r->data);
    return STATUS_OK;
}

static void end_record(struct reader *r) {
    if (r->format == FORMAT_ASCII)
        r->at = r->line_end < r->size ? r->line_end + 1 : r->size;
}

/* Whether the rest of the file can hold the element's records at all. */
static enum status begin_element(struct reader *r, const struct element *e) {
    r->element = e->name;
    uint64_t least = 0;
    for (size_t i = 0; i < e->property_count; i++) {
        const struct property *p = &r->property[e->first + i];
        /* A character and a separator per ASCII value; an empty list still has its length. */
        least += r->format == FORMAT_ASCII ? 2 : type_table[p->is_list ? p->count_type : p->type].bytes;
    }
    uint64_t rest = r->size - r->at + 1; /* the last line may lack its end */
    if (least > 0 && e->count > rest / least)
        return error_set(r->err, STATUS_INPUT,
                         "%s: the header promises %" PRIu64 " of element %s, but the %" PRIu64
                         " bytes that are left hold at most %" PRIu64,
                         r->name, e->count, e->name, rest - 1, rest / least);
    return STATUS_OK;
}

/* --- elements ---------------------------------------------------------------------------- */

static size_t find_property(const struct reader *r, const struct element *e, const char *name) {
    for (size_t i = 0; i < e->property_count; i++)
        if (strcmp(r->property[e->first + i].name, name) == 0)
            return i;
    return SIZE_MAX;
}

static enum status skip_element(struct reader *r, const struct element *e) {
    enum status status = begin_element(r, e);
    if (e->property_count == 0)
        return status;
    for (uint64_t i = 0; status == STATUS_OK && i < e->count; i++) {
        status = begin_record(r, i);
        for (size_t k = 0; status == STATUS_OK && k < e->property_count; k++)
            status = skip_property(r, &r->property[e->first + k]);
        end_record(r);
    }
    return status;
}

static enum status read_vertices(struct reader *r, const struct element *e, struct mesh *mesh) {
    static const char *const wanted[6] = {"x", "y", "z", "nx", "ny", "nz"};
    signed char target[MAX_PROPERTIES]; /* which of the six a property is; -1: none */
    memset(target, -1, sizeof target);
    bool has_normal = true;
    for (int i = 0; i < 6; i++) {
        size_t k = find_property(r, e, wanted[i]);
        bool usable = k != SIZE_MAX && !r->property[e->first + k].is_list;
        if (usable)
            target[k] = (signed char)i;
        else if (i < 3)
            return error_set(r->err, STATUS_INPUT, "%s: its vertices have no property %s", r->name,
                             wanted[i]);
        else
            has_normal = false;
    }
    enum status status = begin_element(r, e);
    if (status != STATUS_OK)
        return status;
    if (e->count >= UINT32_MAX)
        return error_set(r->err, STATUS_LIMIT, "%s has %" PRIu64 " vertices, more than fit",
                         r->name, e->count);
    mesh->vertex_count = (size_t)e->count;
    mesh->position = mem_array(mesh->vertex_count, sizeof *mesh->position);
    if (has_normal)
        mesh->normal = mem_array(mesh->vertex_count, sizeof *mesh->normal);
    for (size_t i = 0; i < mesh->vertex_count; i++) {
        double v[6] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
        status = begin_record(r, i);
        for (size_t k = 0; status == STATUS_OK && k < e->property_count; k++) {
            const struct property *p = &r->property[e->first + k];
            status = target[k] >= 0 ? read_value(r, p->type, &v[(int)target[k]]) : skip_property(r, p);
        }
        if (status != STATUS_OK)
            return status;
        end_record(r);
        mesh->position[i] = vec3_make((float)v[0], (float)v[1], (float)v[2]);
        if (has_normal)
            mesh->normal[i] = vec3_make((float)v[3], (float)v[4], (float)v[5]);
    }
    return STATUS_OK;
}

/* Where faces go, and room for one polygon. */
struct face_sink {
    struct mesh *mesh;
    size_t capacity, limit; /* triangles */
    bool has_object_id;
    size_t corner_count;
    uint32_t corner[POLYGON_MAX_CORNERS];
    vec3 position[POLYGON_MAX_CORNERS];
    uint32_t triangle[POLYGON_MAX_CORNERS][3];
};

static enum status read_corners(struct reader *r, const struct property *p, struct face_sink *sink) {
    uint64_t count;
    enum status status = read_list_count(r, p, &count);
    if (status == STATUS_OK && count > POLYGON_MAX_CORNERS)
        return value_error(r, "has more than 1024 corners");
    for (uint64_t i = 0; status == STATUS_OK && i < count; i++) {
        double value;
        status = read_value(r, p->type, &value);
        if (status != STATUS_OK)
            break;
        if (!(value >= 0.0 && value < (double)sink->mesh->vertex_count) || value != floor(value)) {
            char what[128];
            snprintf(what, sizeof what, "refers to vertex %.15g, but vertices run from 0 to %zu",
                     value, sink->mesh->vertex_count - 1);
            return value_error(r, sink->mesh->vertex_count ? what : "refers to a vertex, but there are none");
        }
        sink->corner[i] = (uint32_t)value;
        sink->position[i] = sink->mesh->position[sink->corner[i]];
    }
    sink->corner_count = (size_t)count;
    return status;
}

static void reserve_triangles(struct face_sink *sink, size_t wanted) {
    if (wanted <= sink->capacity)
        return;
    struct mesh *mesh = sink->mesh;
    size_t grown = sink->capacity + sink->capacity / 2;
    sink->capacity = grown > wanted ? grown : wanted;
    mesh->index = mem_realloc_array(mesh->index, sink->capacity, sizeof *mesh->index);
    mesh->face = mem_realloc_array(mesh->face, sink->capacity, sizeof *mesh->face);
    if (sink->has_object_id)
        mesh->object_id = mem_realloc_array(mesh->object_id, sink->capacity, sizeof *mesh->object_id);
}

static enum status add_face(struct reader *r, struct face_sink *sink, size_t face, int64_t object_id) {
    struct mesh *mesh = sink->mesh;
    size_t made = sink->corner_count - 2;
    if (made > sink->limit - mesh->triangle_count)
        return error_set(r->err, STATUS_LIMIT, "%s has more than %zu triangles, the limit", r->name,
                         sink->limit);
    reserve_triangles(sink, mesh->triangle_count + made);
    polygon_triangulate(sink->position, sink->corner_count, sink->triangle);
    for (size_t i = 0; i < made; i++) {
        size_t at = mesh->triangle_count++;
        for (int k = 0; k < 3; k++)
            mesh->index[at][k] = sink->corner[sink->triangle[i][k]];
        mesh->face[at] = (uint32_t)face;
        if (sink->has_object_id)
            mesh->object_id[at] = object_id;
    }
    return STATUS_OK;
}

static enum status find_face_properties(struct reader *r, const struct element *e, size_t *list,
                                        size_t *id) {
    *list = find_property(r, e, "vertex_indices");
    if (*list == SIZE_MAX)
        *list = find_property(r, e, "vertex_index");
    if (*list == SIZE_MAX || !r->property[e->first + *list].is_list ||
        r->property[e->first + *list].type >= FLOAT32)
        return error_set(r->err, STATUS_INPUT,
                         "%s: its faces have no list vertex_indices of an integer type", r->name);
    *id = find_property(r, e, "object_id");
    if (*id != SIZE_MAX &&
        (r->property[e->first + *id].is_list || r->property[e->first + *id].type >= FLOAT32))
        return error_set(r->err, STATUS_INPUT,
                         "%s: the faces' object_id must be one integer per face", r->name);
    return STATUS_OK;
}

static enum status read_faces(struct reader *r, const struct element *e, struct face_sink *sink,
                              struct ply_report *report) {
    size_t list = SIZE_MAX, id = SIZE_MAX;
    enum status status = find_face_properties(r, e, &list, &id);
    if (status == STATUS_OK)
        status = begin_element(r, e);
    if (status != STATUS_OK)
        return status;
    if (e->count > sink->limit)
        return error_set(r->err, STATUS_LIMIT, "%s has %" PRIu64 " faces, more than the limit of %zu",
                         r->name, e->count, sink->limit);
    sink->mesh->face_count = (size_t)e->count;
    sink->has_object_id = id != SIZE_MAX;
    reserve_triangles(sink, sink->mesh->face_count);
    for (size_t i = 0; i < sink->mesh->face_count; i++) {
        double object_id = 0.0;
        status = begin_record(r, i);
        for (size_t k = 0; status == STATUS_OK && k < e->property_count; k++) {
            const struct property *p = &r->property[e->first + k];
            if (k == list)
                status = read_corners(r, p, sink);
            else if (k == id)
                status = read_value(r, p->type, &object_id);
            else
                status = skip_property(r, p);
        }
        if (status != STATUS_OK)
            return status;
        end_record(r);
        if (sink->corner_count < 3) {
            report->small_count++;
            continue;
        }
        report->polygon_count += sink->corner_count > 4;
        /* In text nothing holds the value to its type; out of range would be undefined. */
        if (!(fabs(object_id) < 0x1p53) || object_id != floor(object_id))
            return value_error(r, "has an object_id that is no integer");
        status = add_face(r, sink, i, (int64_t)object_id);
        if (status != STATUS_OK)
            return status;
    }
    return STATUS_OK;
}

static enum status read_body(struct reader *r, struct face_sink *sink, struct ply_report *report) {
    bool has_vertices = false, has_faces = false;
    const struct element *later = NULL; /* faces that come before the vertices */
    size_t later_at = 0, later_line = 0;
    for (size_t i = 0; i < r->element_count; i++) {
        const struct element *e = &r->elements[i];
        enum status status;
        if (!has_vertices && strcmp(e->name, "vertex") == 0) {
            has_vertices = true;
            status = read_vertices(r, e, sink->mesh);
        } else if (!has_faces && strcmp(e->name, "face") == 0) {
            has_faces = true;
            if (has_vertices) {
                status = read_faces(r, e, sink, report);
            } else {
                later = e;
                later_at = r->at;
                later_line = r->line;
                status = skip_element(r, e);
            }
        } else {
            status = skip_element(r, e);
        }
        if (status != STATUS_OK)
            return status;
    }
    if (!has_vertices || !has_faces) {
        error_set(r->err, STATUS_INPUT, "%s has no %s: it has no \"element %s\"", r->name,
                  has_vertices ? "faces" : "vertices", has_vertices ? "face" : "vertex");
        return error_hint(r->err, "a mesh of triangles or polygons is needed, not a point cloud or "
                          "triangle strips");
    }
    if (!later)
        return STATUS_OK;
    r->at = later_at;
    r->line = later_line;
    return read_faces(r, later, sink, report);
}

enum status ply_parse(const void *data, size_t size, const char *name, size_t triangle_limit,
                      struct mesh *mesh, struct ply_report *report, struct error *err) {
    struct ply_report own_report;
    if (!report)
        report = &own_report;
    *report = (struct ply_report){0};
    *mesh = (struct mesh){0};
    struct reader *r = mem_calloc(1, sizeof *r);
    struct face_sink *sink = mem_calloc(1, sizeof *sink);
    r->name = name;
    r->data = data;
    r->size = size;
    r->err = err;
    sink->mesh = mesh;
    sink->limit = triangle_limit < MESH_MAX_TRIANGLES ? triangle_limit : MESH_MAX_TRIANGLES;
    enum status status = parse_header(r);
    if (status == STATUS_OK)
        status = read_body(r, sink, report);
    if (status != STATUS_OK)
        mesh_release(mesh);
    mem_free(sink);
    mem_free(r);
    return status;
}

enum status ply_read(const char *path, const char *name, size_t triangle_limit, struct mesh *mesh,
                     struct ply_report *report, struct error *err) {
    *mesh = (struct mesh){0};
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0)
        return error_set_errno(err, errno, "cannot open %s", name);
    enum status status;
    struct stat info;
    if (fstat(fd, &info) != 0) {
        status = error_set_errno(err, errno, "cannot ask for the size of %s", name);
    } else if (!S_ISREG(info.st_mode) || info.st_size == 0) {
        status = error_set(err, STATUS_INPUT, "%s is not a PLY file: it is %s", name,
                           S_ISREG(info.st_mode) ? "empty" : "no regular file");
    } else {
        /* Nobody else writes to an unpacked bundle, so the mapping does not shrink under us. */
        size_t size = (size_t)info.st_size;
        void *data = mmap(NULL, size, PROT_READ, MAP_PRIVATE, fd, 0);
        if (data == MAP_FAILED) {
            status = error_set_errno(err, errno, "cannot map %s", name);
        } else {
            status = ply_parse(data, size, name, triangle_limit, mesh, report, err);
            munmap(data, size);
        }
    }
    close(fd);
    return status;
}
