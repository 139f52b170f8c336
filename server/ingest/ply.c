/* ply.c -- see ply.h; ply_header.c reads the header, this file the body.
 *
 * The file is read in place. Counts in the header are checked against the file's size before memory is allocated. An
 * ASCII record is one line; extra values are ignored, missing ones are an error. */
#include "server/ingest/ply.h"

#include <inttypes.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "server/ingest/mapping.h"
#include "server/ingest/ply_header.h"
#include "server/ingest/positions.h"

#define MAX_TOKEN 64 /* characters of a number */

struct ply_reader {
    struct ply_cursor cursor;
    struct ply_header header;
    const char *element; /* element being read, for messages */
    uint64_t record;
    struct positions position;
    struct error *err;
};

/* --- values ------------------------------------------------------------------------------ */

static enum status value_error(struct ply_reader *r, const char *what) {
    bool ascii = r->header.format == PLY_ASCII;
    return error_set(r->err, STATUS_INPUT, "%s, %s %zu: %s %" PRIu64 " %s", r->cursor.name, ascii ? "line" : "byte",
                     ascii ? r->cursor.line : r->cursor.at, r->element, r->record, what);
}

static uint64_t load(const uint8_t *at, size_t bytes, bool big) {
    uint64_t bits = 0;
    for (size_t i = 0; i < bytes; i++)
        bits |= (uint64_t)at[big ? bytes - 1 - i : i] << (8 * i);
    return bits;
}

static enum status read_binary(struct ply_reader *r, enum ply_type type, double *value) {
    size_t bytes = ply_type_bytes(type);
    if (r->cursor.size - r->cursor.at < bytes)
        return value_error(r, "is cut off: the file ends there");
    uint64_t bits = load(r->cursor.data + r->cursor.at, bytes, r->header.format == PLY_BIG_ENDIAN);
    r->cursor.at += bytes;
    float single;
    uint32_t low = (uint32_t)bits;
    switch (type) {
    case PLY_INT8: *value = (int8_t)bits; break;
    case PLY_INT16: *value = (int16_t)bits; break;
    case PLY_INT32: *value = (int32_t)low; break;
    case PLY_UINT8:
    case PLY_UINT16:
    case PLY_UINT32: *value = low; break;
    case PLY_FLOAT32:
        memcpy(&single, &low, sizeof single);
        *value = (double)single;
        break;
    case PLY_FLOAT64: memcpy(value, &bits, sizeof *value); break;
    }
    return STATUS_OK;
}

static bool is_blank(uint8_t c) { return c == ' ' || c == '\t' || c == '\r'; }

static enum status read_ascii(struct ply_reader *r, double *value) {
    while (r->cursor.at < r->cursor.line_end && is_blank(r->cursor.data[r->cursor.at]))
        r->cursor.at++;
    if (r->cursor.at >= r->cursor.line_end)
        return value_error(r, "has fewer values than the header says");
    char token[MAX_TOKEN];
    size_t length = 0;
    while (r->cursor.at < r->cursor.line_end && !is_blank(r->cursor.data[r->cursor.at])) {
        if (length + 1 == sizeof token)
            return value_error(r, "has a value that is not a number");
        token[length++] = (char)r->cursor.data[r->cursor.at++];
    }
    token[length] = '\0';
    char *end;
    *value = strtod(token, &end);
    if (end != token + length || strpbrk(token, "xX("))
        return value_error(r, "has a value that is not a number");
    return STATUS_OK;
}

static enum status read_value(struct ply_reader *r, enum ply_type type, double *value) {
    return r->header.format == PLY_ASCII ? read_ascii(r, value) : read_binary(r, type, value);
}

static enum status read_list_count(struct ply_reader *r, const struct ply_property *p, uint64_t *count) {
    double value;
    enum status status = read_value(r, p->count_type, &value);
    if (status != STATUS_OK)
        return status;
    if (!(value >= 0.0 && value <= UINT32_MAX) || value != floor(value))
        return value_error(r, "has a list of impossible length");
    *count = (uint64_t)value;
    return STATUS_OK;
}

static enum status skip_property(struct ply_reader *r, const struct ply_property *p) {
    uint64_t count = 1;
    double ignored;
    if (p->is_list) {
        enum status status = read_list_count(r, p, &count);
        if (status != STATUS_OK)
            return status;
    }
    if (r->header.format != PLY_ASCII) {
        if ((r->cursor.size - r->cursor.at) / ply_type_bytes(p->type) < count)
            return value_error(r, "is cut off: the file ends there");
        r->cursor.at += (size_t)count * ply_type_bytes(p->type);
        return STATUS_OK;
    }
    for (uint64_t i = 0; i < count; i++) {
        enum status status = read_ascii(r, &ignored);
        if (status != STATUS_OK)
            return status;
    }
    return STATUS_OK;
}

/* Moves to the first value of the next record; in ASCII, skips blank lines. */
static enum status begin_record(struct ply_reader *r, uint64_t record) {
    r->record = record;
    if (r->header.format != PLY_ASCII)
        return STATUS_OK;
    const uint8_t *line;
    size_t length;
    do {
        if (!ply_next_line(&r->cursor, &line, &length))
            return value_error(r, "is missing: the file ends there");
        while (length > 0 && is_blank(line[0])) {
            line++;
            length--;
        }
    } while (length == 0);
    r->cursor.at = (size_t)(line - r->cursor.data);
    return STATUS_OK;
}

static void end_record(struct ply_reader *r) {
    if (r->header.format == PLY_ASCII)
        r->cursor.at = r->cursor.line_end < r->cursor.size ? r->cursor.line_end + 1 : r->cursor.size;
}

/* Checks that the rest of the file is large enough for the element's records. */
static enum status begin_element(struct ply_reader *r, const struct ply_element *e) {
    r->element = e->name;
    uint64_t least = 0;
    for (size_t i = 0; i < e->property_count; i++) {
        const struct ply_property *p = &r->header.property[e->first + i];
        /* A character and a separator per ASCII value; an empty list still has its length. */
        enum ply_type first = p->is_list ? p->count_type : p->type;
        least += r->header.format == PLY_ASCII ? 2 : ply_type_bytes(first);
    }
    uint64_t rest = r->cursor.size - r->cursor.at + 1; /* the last line may lack its newline */
    if (least > 0 && e->count > rest / least)
        return error_set(r->err, STATUS_INPUT,
                         "%s: the header promises %" PRIu64 " of element %s, but the %" PRIu64
                         " bytes that are left hold at most %" PRIu64,
                         r->cursor.name, e->count, e->name, rest - 1, rest / least);
    return STATUS_OK;
}

/* --- elements ---------------------------------------------------------------------------- */

static size_t find_property(const struct ply_reader *r, const struct ply_element *e, const char *name) {
    for (size_t i = 0; i < e->property_count; i++)
        if (strcmp(r->header.property[e->first + i].name, name) == 0)
            return i;
    return SIZE_MAX;
}

static enum status skip_element(struct ply_reader *r, const struct ply_element *e) {
    enum status status = begin_element(r, e);
    if (e->property_count == 0)
        return status;
    for (uint64_t i = 0; status == STATUS_OK && i < e->count; i++) {
        status = begin_record(r, i);
        for (size_t k = 0; status == STATUS_OK && k < e->property_count; k++)
            status = skip_property(r, &r->header.property[e->first + k]);
        end_record(r);
    }
    return status;
}

static enum status read_vertices(struct ply_reader *r, const struct ply_element *e, struct mesh *mesh) {
    static const char *const wanted[6] = {"x", "y", "z", "nx", "ny", "nz"};
    signed char target[PLY_MAX_PROPERTIES]; /* index of the wanted property among six; -1: none */
    memset(target, -1, sizeof target);
    bool has_normal = true, is_single[6] = {false};
    for (int i = 0; i < 6; i++) {
        size_t k = find_property(r, e, wanted[i]);
        bool usable = k != SIZE_MAX && !r->header.property[e->first + k].is_list;
        if (usable) {
            target[k] = (signed char)i;
            is_single[i] = r->header.format != PLY_ASCII && r->header.property[e->first + k].type == PLY_FLOAT32;
        } else if (i < 3) {
            return error_set(r->err, STATUS_INPUT, "%s: its vertices have no property %s", r->cursor.name, wanted[i]);
        } else {
            has_normal = false;
        }
    }
    enum status status = begin_element(r, e);
    if (status != STATUS_OK)
        return status;
    if (e->count >= UINT32_MAX)
        return error_set(r->err, STATUS_LIMIT, "%s has %" PRIu64 " vertices, more than fit", r->cursor.name, e->count);
    mesh->vertex_count = r->position.capacity = (size_t)e->count;
    r->position.at = mem_array(mesh->vertex_count, sizeof *r->position.at);
    if (has_normal)
        mesh->normal = mem_array(mesh->vertex_count, sizeof *mesh->normal);
    for (size_t i = 0; i < mesh->vertex_count; i++) {
        double v[6] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
        status = begin_record(r, i);
        for (size_t k = 0; status == STATUS_OK && k < e->property_count; k++) {
            const struct ply_property *p = &r->header.property[e->first + k];
            status = target[k] >= 0 ? read_value(r, p->type, &v[(int)target[k]]) : skip_property(r, p);
        }
        if (status != STATUS_OK)
            return status;
        end_record(r);
        positions_append(&r->position, v);
        for (int k = 0; k < 3; k++)
            r->position.single = is_single[k] ? fmax(r->position.single, fabs(v[k])) : r->position.single;
        if (has_normal)
            mesh->normal[i] = vec3_make((float)v[3], (float)v[4], (float)v[5]);
    }
    return STATUS_OK;
}

static enum status read_corners(struct ply_reader *r, const struct ply_property *p, struct faces *faces) {
    uint64_t count;
    enum status status = read_list_count(r, p, &count);
    if (status == STATUS_OK && count > POLYGON_MAX_CORNERS)
        return value_error(r, "has more than 1024 corners");
    for (uint64_t i = 0; status == STATUS_OK && i < count; i++) {
        double value;
        status = read_value(r, p->type, &value);
        if (status != STATUS_OK)
            break;
        if (!(value >= 0.0 && value < (double)faces->mesh->vertex_count) || value != floor(value)) {
            char what[128];
            snprintf(what, sizeof what, "refers to vertex %.15g, but vertices run from 0 to %zu", value,
                     faces->mesh->vertex_count - 1);
            return value_error(r, faces->mesh->vertex_count > 0 ? what : "refers to a vertex of none");
        }
        faces->corner[i] = (uint32_t)value;
        memcpy(faces->position[i], r->position.at[faces->corner[i]], sizeof faces->position[i]);
    }
    faces->corner_count = (size_t)count;
    return status;
}

static enum status find_face_properties(struct ply_reader *r, const struct ply_element *e, size_t *list, size_t *id) {
    *list = find_property(r, e, "vertex_indices");
    if (*list == SIZE_MAX)
        *list = find_property(r, e, "vertex_index");
    if (*list == SIZE_MAX || !r->header.property[e->first + *list].is_list ||
        r->header.property[e->first + *list].type >= PLY_FLOAT32)
        return error_set(r->err, STATUS_INPUT, "%s: its faces have no list vertex_indices of an integer type",
                         r->cursor.name);
    *id = find_property(r, e, "object_id");
    const struct ply_property *p = *id != SIZE_MAX ? &r->header.property[e->first + *id] : NULL;
    if (p && (p->is_list || p->type >= PLY_FLOAT32))
        return error_set(r->err, STATUS_INPUT, "%s: the faces' object_id must be one integer per face", r->cursor.name);
    return STATUS_OK;
}

static enum status read_faces(struct ply_reader *r, const struct ply_element *e, struct faces *faces) {
    size_t list = SIZE_MAX, id = SIZE_MAX;
    enum status status = find_face_properties(r, e, &list, &id);
    if (status == STATUS_OK)
        status = begin_element(r, e);
    if (status != STATUS_OK)
        return status;
    if (e->count > faces->limit)
        return error_set(r->err, STATUS_LIMIT, "%s has %" PRIu64 " faces, more than the limit of %zu", r->cursor.name,
                         e->count, faces->limit);
    faces->has_object_id = id != SIZE_MAX;
    faces_reserve(faces, (size_t)e->count);
    for (size_t i = 0; i < e->count; i++) {
        double object_id = 0.0;
        status = begin_record(r, i);
        for (size_t k = 0; status == STATUS_OK && k < e->property_count; k++) {
            const struct ply_property *p = &r->header.property[e->first + k];
            if (k == list)
                status = read_corners(r, p, faces);
            else if (k == id)
                status = read_value(r, p->type, &object_id);
            else
                status = skip_property(r, p);
        }
        if (status != STATUS_OK)
            return status;
        end_record(r);
        /* ASCII values are unbounded, and the conversion would be undefined out of range */
        if (!(fabs(object_id) < 0x1p53) || object_id != floor(object_id))
            return value_error(r, "has an object_id that is no integer");
        status = faces_add(faces, (int64_t)object_id, r->err);
        if (status != STATUS_OK)
            return status;
    }
    return STATUS_OK;
}

static enum status read_body(struct ply_reader *r, struct faces *faces) {
    bool has_vertices = false, has_faces = false;
    const struct ply_element *later = NULL; /* faces that precede the vertices */
    size_t later_at = 0, later_line = 0;
    for (size_t i = 0; i < r->header.element_count; i++) {
        const struct ply_element *e = &r->header.element[i];
        enum status status;
        if (!has_vertices && strcmp(e->name, "vertex") == 0) {
            has_vertices = true;
            status = read_vertices(r, e, faces->mesh);
        } else if (!has_faces && strcmp(e->name, "face") == 0) {
            has_faces = true;
            if (has_vertices) {
                status = read_faces(r, e, faces);
            } else {
                later = e;
                later_at = r->cursor.at;
                later_line = r->cursor.line;
                status = skip_element(r, e);
            }
        } else {
            status = skip_element(r, e);
        }
        if (status != STATUS_OK)
            return status;
    }
    if (!has_vertices || !has_faces) {
        error_set(r->err, STATUS_INPUT, "%s has no %s: it has no \"element %s\"", r->cursor.name,
                  has_vertices ? "faces" : "vertices", has_vertices ? "face" : "vertex");
        return error_hint(r->err, "a mesh of triangles or polygons is needed, not a point cloud or "
                                  "triangle strips");
    }
    if (!later)
        return STATUS_OK;
    r->cursor.at = later_at;
    r->cursor.line = later_line;
    return read_faces(r, later, faces);
}

enum status ply_parse(const void *data, size_t size, const char *name, size_t triangle_limit, struct mesh *mesh,
                      struct faces_report *report, struct error *err) {
    *mesh = (struct mesh){0};
    struct ply_reader *r = mem_calloc(1, sizeof *r);
    struct faces *faces = faces_new(mesh, name, triangle_limit, false);
    r->cursor = (struct ply_cursor){.name = name, .data = data, .size = size};
    r->err = err;
    enum status status = ply_header_parse(&r->cursor, &r->header, err);
    memcpy(r->position.offset, r->header.offset, sizeof r->position.offset);
    if (status == STATUS_OK)
        status = read_body(r, faces);
    faces->report.step_m = positions_step(r->position.single);
    if (status == STATUS_OK)
        positions_settle(&r->position, mesh);
    else
        mesh_release(mesh);
    positions_release(&r->position);
    if (report)
        *report = faces->report;
    mem_free(faces);
    mem_free(r);
    return status;
}

#define KIND "a PLY file"

enum status ply_read(const char *path, const char *name, size_t triangle_limit, struct mesh *mesh,
                     struct faces_report *report, struct error *err) {
    struct mapping file;
    *mesh = (struct mesh){0};
    enum status status = mapping_open(&file, path, name, KIND, err);
    if (status == STATUS_OK)
        status = ply_parse(file.data, file.size, name, triangle_limit, mesh, report, err);
    mapping_close(&file);
    return status;
}

enum status ply_count_faces(const char *path, const char *name, uint64_t *count, struct error *err) {
    struct mapping file;
    enum status status = mapping_open(&file, path, name, KIND, err);
    if (status != STATUS_OK)
        return status;
    struct ply_header *header = mem_alloc(sizeof *header);
    struct ply_cursor cursor = {.name = name, .data = file.data, .size = file.size};
    status = ply_header_parse(&cursor, header, err);
    const struct ply_element *face = status == STATUS_OK ? ply_find_element(header, "face") : NULL;
    *count = face ? face->count : 0;
    mem_free(header);
    mapping_close(&file);
    return status;
}
