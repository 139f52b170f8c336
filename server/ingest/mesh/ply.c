/* ply.c -- see ply.h; ply_header.c reads the header, ply_values.c numbers, ply_vertices.c
 * vertices, this file faces.
 *
 * The file is read in place. Counts in the header are checked against the file's size before memory is allocated. */
#include "server/ingest/mesh/ply.h"

#include <inttypes.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "common/mem.h"
#include "server/ingest/mapping.h"
#include "server/ingest/mesh/ply_values.h"
#include "server/ingest/mesh/ply_vertices.h"

#define PLY_TEXCOORD_MAX (2 * POLYGON_MAX_CORNERS) /* numbers of a face's list */

struct ply_reader {
    struct ply_values in;
    struct ply_vertices vertices;
    double texcoord[PLY_TEXCOORD_MAX]; /* of the face being read */
    uint64_t texcoord_count;
    struct error *err;
};

/* --- elements ---------------------------------------------------------------------------- */

static enum status skip_element(struct ply_reader *r, const struct ply_element *e) {
    enum status status = ply_begin_element(&r->in, e);
    if (e->property_count == 0)
        return status;
    for (uint64_t i = 0; status == STATUS_OK && i < e->count; i++) {
        status = ply_begin_record(&r->in, i);
        for (size_t k = 0; status == STATUS_OK && k < e->property_count; k++)
            status = ply_skip_property(&r->in, &r->in.header.property[e->first + k]);
        if (status == STATUS_OK)
            status = ply_end_record(&r->in);
    }
    return status;
}

static enum status check_vertex(struct ply_reader *r, const struct faces *faces, double value) {
    size_t count = faces->mesh->vertex_count;
    char what[128];
    if (value >= 0.0 && value < (double)count && value == floor(value))
        return STATUS_OK;
    snprintf(what, sizeof what, "refers to vertex %.15g, but vertices run from 0 to %zu", value, count - 1);
    return ply_value_error(&r->in, count > 0 ? what : "refers to a vertex of none");
}

static void set_corner(const struct ply_reader *r, struct faces *faces, size_t corner, double vertex) {
    faces->corner[corner] = (uint32_t)vertex;
    memcpy(faces->position[corner], r->vertices.position.at[faces->corner[corner]], sizeof faces->position[corner]);
    faces->has_uv = r->vertices.uv != NULL;
    if (r->vertices.uv)
        faces->uv[corner] = r->vertices.uv[faces->corner[corner]];
}

static enum status read_corners(struct ply_reader *r, const struct ply_property *p, struct faces *faces) {
    uint64_t count;
    enum status status = ply_read_list_count(&r->in, p, &count);
    if (status == STATUS_OK && count > POLYGON_MAX_CORNERS)
        return ply_value_error(&r->in, "has more than 1024 corners");
    for (uint64_t i = 0; status == STATUS_OK && i < count; i++) {
        double value;
        status = ply_read_value(&r->in, p->type, &value);
        if (status == STATUS_OK)
            status = check_vertex(r, faces, value);
        if (status == STATUS_OK)
            set_corner(r, faces, (size_t)i, value);
    }
    faces->corner_count = (size_t)count;
    return status;
}

/* Two numbers a corner, as MeshLab writes them; a list of another length says nothing. */
static enum status read_texcoord(struct ply_reader *r, const struct ply_property *p) {
    enum status status = ply_read_list_count(&r->in, p, &r->texcoord_count);
    for (uint64_t i = 0; status == STATUS_OK && i < r->texcoord_count; i++) {
        double value;
        status = ply_read_value(&r->in, p->type, &value);
        if (i < PLY_TEXCOORD_MAX)
            r->texcoord[i] = value;
    }
    return status;
}

static void set_texcoord(const struct ply_reader *r, struct faces *faces) {
    if (r->texcoord_count == 0 || r->texcoord_count != 2 * faces->corner_count)
        return;
    for (size_t i = 0; i < faces->corner_count; i++)
        faces->uv[i] = (vec2){(float)r->texcoord[2 * i], (float)r->texcoord[2 * i + 1]};
    faces->has_uv = true;
}

static enum status find_indices(struct ply_reader *r, const struct ply_element *e, size_t *list) {
    *list = ply_find_property(&r->in.header, e, "vertex_indices");
    if (*list == SIZE_MAX)
        *list = ply_find_property(&r->in.header, e, "vertex_index");
    if (*list == SIZE_MAX || !r->in.header.property[e->first + *list].is_list ||
        r->in.header.property[e->first + *list].type >= PLY_FLOAT32)
        return error_set(r->err, STATUS_INPUT, "%s: its %ss have no list vertex_indices of an integer type",
                         r->in.cursor.name, strcasecmp(e->name, "face") == 0 ? "face" : "strip");
    return STATUS_OK;
}

/* Numbers of its properties; SIZE_MAX: none. */
struct face_layout {
    size_t list, id, texcoord;
};

static enum status find_face_properties(struct ply_reader *r, const struct ply_element *e, struct face_layout *layout) {
    *layout = (struct face_layout){SIZE_MAX, SIZE_MAX, SIZE_MAX};
    enum status status = find_indices(r, e, &layout->list);
    if (status != STATUS_OK)
        return status;
    layout->id = ply_find_property(&r->in.header, e, "object_id");
    layout->texcoord = ply_find_property(&r->in.header, e, "texcoord");
    if (layout->texcoord != SIZE_MAX && !r->in.header.property[e->first + layout->texcoord].is_list)
        layout->texcoord = SIZE_MAX;
    const struct ply_property *p = layout->id != SIZE_MAX ? &r->in.header.property[e->first + layout->id] : NULL;
    if (p && (p->is_list || p->type >= PLY_FLOAT32))
        return error_set(r->err, STATUS_INPUT, "%s: the faces' object_id must be one integer per face",
                         r->in.cursor.name);
    return STATUS_OK;
}

static enum status read_faces(struct ply_reader *r, const struct ply_element *e, struct faces *faces) {
    struct face_layout layout;
    enum status status = find_face_properties(r, e, &layout);
    if (status == STATUS_OK)
        status = ply_begin_element(&r->in, e);
    if (status != STATUS_OK)
        return status;
    if (e->count > faces->limit)
        return error_set(r->err, STATUS_LIMIT, "%s has %" PRIu64 " faces, more than the limit of %zu",
                         r->in.cursor.name, e->count, faces->limit);
    faces->has_object_id = layout.id != SIZE_MAX;
    faces_reserve(faces, (size_t)e->count);
    for (size_t i = 0; i < e->count; i++) {
        double object_id = 0.0;
        status = ply_begin_record(&r->in, i);
        for (size_t k = 0; status == STATUS_OK && k < e->property_count; k++) {
            const struct ply_property *p = &r->in.header.property[e->first + k];
            if (k == layout.list)
                status = read_corners(r, p, faces);
            else if (k == layout.id)
                status = ply_read_value(&r->in, p->type, &object_id);
            else if (k == layout.texcoord)
                status = read_texcoord(r, p);
            else
                status = ply_skip_property(&r->in, p);
        }
        if (status == STATUS_OK)
            status = ply_end_record(&r->in);
        if (status != STATUS_OK)
            return status;
        /* ASCII values are unbounded, and the conversion would be undefined out of range */
        if (!(fabs(object_id) < 0x1p53) || object_id != floor(object_id))
            return ply_value_error(&r->in, "has an object_id that is no integer");
        set_texcoord(r, faces);
        status = faces_add(faces, (int64_t)object_id, r->err);
        if (status != STATUS_OK)
            return status;
    }
    return STATUS_OK;
}

/* Triangles of a strip: each index makes one with the two before it, turned in every second; -1 starts anew. A
 * triangle with a vertex twice only leads to the next. */
static enum status read_strip(struct ply_reader *r, const struct ply_property *p, struct faces *faces) {
    uint64_t count;
    double before[2] = {-1.0, -1.0};
    bool turned = false;
    enum status status = ply_read_list_count(&r->in, p, &count);
    for (uint64_t i = 0; status == STATUS_OK && i < count; i++) {
        double value;
        status = ply_read_value(&r->in, p->type, &value);
        if (status == STATUS_OK && value != -1.0)
            status = check_vertex(r, faces, value);
        if (status != STATUS_OK)
            break;
        bool leads = before[0] < 0.0 || before[1] < 0.0;
        if (!leads && value >= 0.0 && value != before[0] && value != before[1] && before[0] != before[1]) {
            const double corner[3] = {before[turned], before[!turned], value};
            faces->corner_count = 3;
            for (int k = 0; k < 3; k++)
                set_corner(r, faces, (size_t)k, corner[k]);
            status = faces_add(faces, 0, r->err);
        }
        turned = !leads && value >= 0.0 && !turned;
        before[0] = value < 0.0 ? -1.0 : before[1];
        before[1] = value;
    }
    return status;
}

static enum status read_strips(struct ply_reader *r, const struct ply_element *e, struct faces *faces) {
    size_t list = SIZE_MAX;
    enum status status = find_indices(r, e, &list);
    if (status == STATUS_OK)
        status = ply_begin_element(&r->in, e);
    for (uint64_t i = 0; i < e->count && status == STATUS_OK; i++) {
        status = ply_begin_record(&r->in, i);
        for (size_t k = 0; status == STATUS_OK && k < e->property_count; k++) {
            const struct ply_property *p = &r->in.header.property[e->first + k];
            status = k == list ? read_strip(r, p, faces) : ply_skip_property(&r->in, p);
        }
        if (status == STATUS_OK)
            status = ply_end_record(&r->in);
    }
    return status;
}

static enum status read_surface(struct ply_reader *r, const struct ply_element *e, struct faces *faces) {
    return strcasecmp(e->name, "face") == 0 ? read_faces(r, e, faces) : read_strips(r, e, faces);
}

/* The element with the surface: faces or, in files without, triangle strips; NULL: none. */
static const struct ply_element *find_surface(const struct ply_header *header) {
    const struct ply_element *face = ply_find_element(header, "face");
    const struct ply_element *strips = ply_find_element(header, "tristrips");
    return strips && (!face || face->count == 0) ? strips : face;
}

static enum status read_body(struct ply_reader *r, struct faces *faces) {
    bool has_vertices = false;
    const struct ply_element *surface = find_surface(&r->in.header);
    struct ply_cursor surface_at = {0}; /* of a surface that precedes the vertices */
    for (size_t i = 0; i < r->in.header.element_count; i++) {
        const struct ply_element *e = &r->in.header.element[i];
        enum status status;
        if (!has_vertices && strcasecmp(e->name, "vertex") == 0) {
            has_vertices = true;
            status = ply_read_vertices(&r->in, e, &r->vertices, faces->mesh);
        } else if (e == surface && has_vertices) {
            status = read_surface(r, e, faces);
        } else {
            if (e == surface)
                surface_at = r->in.cursor;
            status = skip_element(r, e);
        }
        if (status != STATUS_OK)
            return status;
    }
    if (!has_vertices || !surface) {
        error_set(r->err, STATUS_INPUT, "%s has no %s: it has no \"element %s\"", r->in.cursor.name,
                  has_vertices ? "faces" : "vertices", has_vertices ? "face" : "vertex");
        return error_hint(r->err, "a mesh of triangles or polygons is needed, not a point cloud");
    }
    enum status status = ply_end_body(&r->in);
    if (status != STATUS_OK || !surface_at.data)
        return status;
    r->in.cursor = surface_at;
    return read_surface(r, surface, faces);
}

/* *is_broken: it is faulty, but it may be read as a stream. */
static enum status parse(const void *data, size_t size, const char *name, size_t triangle_limit, bool is_stream,
                         bool *is_broken, struct mesh *mesh, struct faces_report *report, struct error *err) {
    *mesh = (struct mesh){0};
    struct ply_reader *r = mem_calloc(1, sizeof *r);
    r->in.is_stream = is_stream;
    struct faces *faces = faces_new(mesh, name, triangle_limit, false);
    r->in.cursor = (struct ply_cursor){.name = name, .data = data, .size = size};
    r->err = r->in.err = err;
    enum status status = ply_header_parse(&r->in.cursor, &r->in.header, err);
    memcpy(r->vertices.position.offset, r->in.header.offset, sizeof r->vertices.position.offset);
    if (status == STATUS_OK)
        status = read_body(r, faces);
    faces->report.step_m = positions_step(r->vertices.position.single);
    if (status == STATUS_OK)
        positions_move_to_mesh(&r->vertices.position, mesh);
    if (status == STATUS_OK)
        mesh->picture_count = r->in.header.picture_count;
    else
        mesh_release(mesh);
    ply_vertices_release(&r->vertices);
    if (report)
        *report = faces->report;
    *is_broken = status == STATUS_INPUT && r->in.header.format == PLY_ASCII && r->in.has_extra && !is_stream;
    mem_free(faces);
    mem_free(r);
    return status;
}

enum status ply_parse(const void *data, size_t size, const char *name, size_t triangle_limit, struct mesh *mesh,
                      struct faces_report *report, struct error *err) {
    struct error other;
    bool is_broken;
    enum status status = parse(data, size, name, triangle_limit, false, &is_broken, mesh, report, err);
    if (is_broken && parse(data, size, name, triangle_limit, true, &is_broken, mesh, report, &other) == STATUS_OK)
        return STATUS_OK;
    return status;
}

enum status ply_count_faces(const char *path, const char *name, uint64_t *count, struct error *err) {
    struct mapping file;
    enum status status = mapping_open(&file, path, name, "a PLY file", err);
    if (status != STATUS_OK)
        return status;
    struct ply_header *header = mem_alloc(sizeof *header);
    struct ply_cursor cursor = {.name = name, .data = file.data, .size = file.size};
    status = ply_header_parse(&cursor, header, err);
    const struct ply_element *surface = status == STATUS_OK ? find_surface(header) : NULL;
    *count = surface ? surface->count : 0;
    mem_free(header);
    mapping_close(&file);
    return status;
}
