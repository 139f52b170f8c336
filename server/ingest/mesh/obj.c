/* obj.c -- see obj.h. One pass over the file in place; memory grows with the lines read, so no count in the file is
 * trusted. */
#include "server/ingest/mesh/obj.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "server/ingest/mapping.h"
#include "server/ingest/mesh/intern.h"
#include "server/ingest/mesh/obj_materials.h"
#include "server/ingest/mesh/obj_objects.h"
#include "server/ingest/mesh/positions.h"

#define MAX_TOKEN 64 /* characters of a number or of a corner of a face */
#define NONE UINT32_MAX
#define NO_CORNER "a corner of the face is not written as v, v/vt, v//vn or v/vt/vn"
/* Below this size there are fewer points than NONE, since each takes a line of 8 bytes, "v 0 0 0". */
#define MAX_BYTES ((size_t)8 * (NONE - 1))

struct obj_reader {
    const char *name, *folder; /* folder: of other files, or NULL */
    const uint8_t *data;
    size_t size, at, line_end; /* `at` is within the line */
    size_t line, next_line;    /* numbers, from 1; a continued line counts as several */
    uint8_t newline;           /* '\r' in files of old Macintosh programs */
    struct positions position, normal, texture;
    struct faces *faces;
    bool lacks_normals;  /* a corner without normal */
    size_t absent_count; /* corners that name a normal which the file does not have */
    struct intern pairs; /* position and normal of each vertex of the mesh */
    uint32_t (*pair)[2]; /* [pairs.count]; owned */
    size_t pair_capacity;
    struct obj_objects objects;
    struct mesh_materials *materials; /* NULL: materials are not read */
    struct error *err;
};

/* --- lines and tokens ----------------------------------------------------------------------- */

static enum status line_error(const struct obj_reader *r, const char *what) {
    return error_set(r->err, STATUS_INPUT, "%s, line %zu: %s", r->name, r->line, what);
}

/* Whether the line that ends at `end` continues in the next. */
static bool is_continued(const struct obj_reader *r, size_t end) {
    if (end > r->at && r->data[end - 1] == '\r')
        end--;
    return end > r->at && r->data[end - 1] == '\\';
}

static bool next_line(struct obj_reader *r) {
    r->at = r->line_end < r->size && r->line > 0 ? r->line_end + 1 : r->line_end;
    if (r->at >= r->size)
        return false;
    r->line = r->next_line;
    for (size_t end = r->at;; end++) {
        const uint8_t *newline = end < r->size ? memchr(r->data + end, r->newline, r->size - end) : NULL;
        r->next_line++;
        end = newline ? (size_t)(newline - r->data) : r->size;
        r->line_end = end;
        if (!newline || !is_continued(r, end))
            return true;
    }
}

/* Skips a byte order mark and finds how lines end. */
static void begin_text(struct obj_reader *r) {
    if (r->size >= 3 && memcmp(r->data, "\xef\xbb\xbf", 3) == 0)
        r->line_end = 3;
    bool has_newline = r->size > 0 && memchr(r->data, '\n', r->size);
    r->newline = has_newline ? '\n' : '\r';
}

static bool is_blank(uint8_t c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n' || c == '\\'; }

/* The next word of the line, "" at its end. A word too long for a number or corner is replaced by an invalid one. */
static size_t next_token(struct obj_reader *r, char token[MAX_TOKEN]) {
    size_t length = 0;
    while (r->at < r->line_end && is_blank(r->data[r->at]))
        r->at++;
    for (; r->at < r->line_end && !is_blank(r->data[r->at]); r->at++) {
        if (length + 1 < MAX_TOKEN)
            token[length++] = (char)r->data[r->at];
        else
            token[0] = '?';
    }
    token[length] = '\0';
    return length;
}

static enum status read_vec3(struct obj_reader *r, struct positions *points) {
    char token[MAX_TOKEN], *end;
    double value[3];
    for (int i = 0; i < 3; i++) {
        if (next_token(r, token) == 0)
            return line_error(r, "three numbers are wanted");
        value[i] = strtod(token, &end);
        if (*end != '\0' || strpbrk(token, "xX("))
            return line_error(r, "there is a value that is not a number");
    }
    positions_append(points, value);
    return STATUS_OK;
}

/* A vt of one to three numbers; what cannot be read stands for none. */
static void read_texture(struct obj_reader *r) {
    char token[MAX_TOKEN], *end;
    double value[3] = {0.0, 0.0, 0.0};
    for (int i = 0; i < 2 && next_token(r, token) > 0; i++) {
        double number = strtod(token, &end);
        value[i] = *end == '\0' && !strpbrk(token, "xX(") ? number : (double)NAN;
    }
    positions_append(&r->texture, value);
}

/* --- labels --------------------------------------------------------------------------------- */

/* The rest of the line, without blanks around it. */
static const uint8_t *rest_of_line(const struct obj_reader *r, size_t *length) {
    size_t from = r->at, to = r->line_end;
    while (from < to && is_blank(r->data[from]))
        from++;
    while (to > from && is_blank(r->data[to - 1]))
        to--;
    *length = to - from;
    return r->data + from;
}

static void read_label(struct obj_reader *r, enum obj_label kind) {
    size_t length;
    const uint8_t *name = rest_of_line(r, &length);
    obj_objects_set(&r->objects, kind, name, length);
}

static void read_library(struct obj_reader *r) {
    size_t length;
    const uint8_t *name = rest_of_line(r, &length);
    obj_objects_set_library(&r->objects, name, length);
}

/* --- faces ---------------------------------------------------------------------------------- */

/* Converts an index of the file (1 for the first of `count`, -1 for the last) to one from 0. */
static enum status resolve(const struct obj_reader *r, const char *text, char **end, size_t count, uint32_t *index) {
    long value = strtol(text, end, 10);
    if (*end == text)
        return line_error(r, NO_CORNER);
    if (value == 0 || value > (long)count || value < -(long)count)
        return error_set(r->err, STATUS_INPUT,
                         "%s, line %zu: the face refers to vertex %ld, but there are %zu above it", r->name, r->line,
                         value, count);
    *index = (uint32_t)(value > 0 ? value - 1 : (long)count + value);
    return STATUS_OK;
}

/* An index of a texture coordinate or a normal, which some programs leave away ("1/2/") or write without any to refer
 * to; NONE then. */
static uint32_t resolve_spare(const char *text, char **end, size_t count) {
    long value = strtol(text, end, 10);
    if (value == 0 || value > (long)count || value < -(long)count)
        return NONE;
    return (uint32_t)(value > 0 ? value - 1 : (long)count + value);
}

/* "v", "v/vt", "v//vn", "v/vt/vn", the last of which may be empty: position and normal (or NONE), texture coordinate
 * (or NONE). */
static enum status read_corner(struct obj_reader *r, char *token, uint32_t pair[2], uint32_t *texture) {
    char *end;
    pair[1] = *texture = NONE;
    enum status status = resolve(r, token, &end, r->position.count, &pair[0]);
    if (status != STATUS_OK)
        return status;
    if (*end == '/')
        *texture = resolve_spare(end + 1, &end, r->texture.count);
    if (*end == '/') {
        const char *normal = end + 1;
        pair[1] = resolve_spare(normal, &end, r->normal.count);
        r->absent_count += pair[1] == NONE && end > normal;
    }
    return *end == '\0' ? STATUS_OK : line_error(r, NO_CORNER);
}

static uint32_t vertex_of(struct obj_reader *r, const uint32_t pair[2]) {
    size_t known = r->pairs.count;
    uint32_t vertex = intern_number(&r->pairs, pair, 2 * sizeof *pair);
    if (vertex < known)
        return vertex;
    if (known == r->pair_capacity) {
        r->pair_capacity = known ? 2 * known : 1024;
        r->pair = mem_realloc_array(r->pair, r->pair_capacity, sizeof *r->pair);
    }
    memcpy(r->pair[vertex], pair, 2 * sizeof *pair);
    return vertex;
}

static enum status read_face(struct obj_reader *r) {
    char token[MAX_TOKEN];
    struct faces *f = r->faces;
    f->corner_count = 0;
    bool has_uv = true;
    while (next_token(r, token) > 0 && token[0] != '#') {
        uint32_t pair[2], texture;
        if (f->corner_count == POLYGON_MAX_CORNERS)
            return line_error(r, "the face has more than 1024 corners");
        enum status status = read_corner(r, token, pair, &texture);
        if (status != STATUS_OK)
            return status;
        r->lacks_normals = r->lacks_normals || pair[1] == NONE;
        f->corner[f->corner_count] = vertex_of(r, pair);
        const double *uv = texture != NONE ? r->texture.at[texture] : NULL;
        has_uv = has_uv && uv;
        if (uv)
            f->uv[f->corner_count] = (vec2){(float)uv[0], (float)uv[1]};
        memcpy(f->position[f->corner_count++], r->position.at[pair[0]], sizeof *f->position);
    }
    f->has_uv = has_uv;
    return faces_add(f, obj_objects_current(&r->objects), r->err);
}

static void read_comment(struct obj_reader *r) {
    char text[128];
    size_t length = r->line_end - r->at;
    if (length >= sizeof text)
        return;
    memcpy(text, r->data + r->at, length);
    text[length] = '\0';
    positions_read_offset(text, r->position.offset);
}

static enum status read_line(struct obj_reader *r) {
    char word[MAX_TOKEN];
    next_token(r, word);
    if (strcmp(word, "v") == 0)
        return read_vec3(r, &r->position);
    if (strcmp(word, "vn") == 0)
        return read_vec3(r, &r->normal);
    if (strcmp(word, "vt") == 0)
        read_texture(r);
    else if (strcmp(word, "f") == 0 || strcmp(word, "fo") == 0)
        return read_face(r);
    if (strcmp(word, "#") == 0)
        read_comment(r);
    else if (strcmp(word, "o") == 0)
        read_label(r, OBJ_OBJECT);
    else if (strcmp(word, "g") == 0)
        read_label(r, OBJ_GROUP);
    else if (strcmp(word, "usemtl") == 0)
        read_label(r, OBJ_MATERIAL);
    else if (strcmp(word, "mtllib") == 0)
        read_library(r);
    return STATUS_OK;
}

/* --- the mesh ------------------------------------------------------------------------------- */

static enum status finish(struct obj_reader *r, struct mesh *mesh) {
    if (r->absent_count > 0)
        faces_note(&r->faces->report,
                   "%zu corners of faces name a normal that is not there: it was read without normals",
                   r->absent_count);
    struct positions vertices = {.capacity = r->pairs.count};
    memcpy(vertices.offset, r->position.offset, sizeof vertices.offset);
    vertices.at = mem_array(vertices.capacity, sizeof *vertices.at);
    for (size_t v = 0; v < r->pairs.count; v++)
        positions_append(&vertices, r->position.at[r->pair[v][0]]);
    positions_release(&r->position);
    if (!r->lacks_normals)
        mesh->normal = mem_array(r->pairs.count, sizeof *mesh->normal);
    for (size_t v = 0; v < r->pairs.count && mesh->normal; v++) {
        const double *n = r->normal.at[r->pair[v][1]];
        mesh->normal[v] = vec3_make((float)n[0], (float)n[1], (float)n[2]);
    }
    positions_move_to_mesh(&vertices, mesh);
    if (r->materials)
        return obj_materials_settle(&r->objects, r->name, r->folder, mesh, r->materials, &r->faces->report, r->err);
    obj_objects_settle(&r->objects, r->folder, mesh, &r->faces->report);
    return STATUS_OK;
}

static enum status check_whole(const struct obj_reader *r) {
    if (memchr(r->data, '\0', r->size < 4096 ? r->size : 4096))
        return error_set(r->err, STATUS_INPUT, "%s is not an OBJ file: it is not text", r->name);
    if (r->faces->mesh->triangle_count > 0)
        return STATUS_OK;
    error_set(r->err, STATUS_INPUT, "%s has no faces: no line of it begins with \"f\"", r->name);
    return error_hint(r->err, "a mesh of triangles or polygons is needed, not a point cloud or curves");
}

enum status obj_parse(const void *data, size_t size, const char *name, const char *folder, size_t triangle_limit,
                      struct mesh *mesh, struct mesh_materials *materials, struct faces_report *report,
                      struct error *err) {
    *mesh = (struct mesh){0};
    if (size > MAX_BYTES)
        return error_set(err, STATUS_LIMIT, "%s is larger than %zu bytes", name, MAX_BYTES);
    struct obj_reader *r = mem_calloc(1, sizeof *r);
    *r = (struct obj_reader){
        .name = name, .folder = folder, .data = data, .size = size, .next_line = 1, .materials = materials, .err = err};
    r->faces = faces_new(mesh, name, triangle_limit, true);
    intern_init(&r->pairs);
    obj_objects_init(&r->objects);
    begin_text(r);
    enum status status = STATUS_OK;
    while (status == STATUS_OK && next_line(r))
        status = read_line(r);
    if (status == STATUS_OK)
        status = check_whole(r);
    if (status == STATUS_OK)
        status = finish(r, mesh);
    if (status != STATUS_OK)
        mesh_release(mesh);
    if (report)
        *report = r->faces->report;
    obj_objects_release(&r->objects);
    intern_release(&r->pairs);
    mem_free(r->pair);
    positions_release(&r->position);
    positions_release(&r->normal);
    positions_release(&r->texture);
    mem_free(r->faces);
    mem_free(r);
    return status;
}
