/* ply_vertices.c -- see ply_vertices.h. */
#include "server/ingest/mesh/ply_vertices.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "common/mem.h"

/* Values of a vertex: position, normal, texture coordinates. */
enum { VERTEX_NORMAL = 3, VERTEX_UV = 6, VERTEX_VALUES = 8 };

struct vertex_layout {
    signed char target[PLY_MAX_PROPERTIES]; /* of each property, number of the value that it is; -1: none */
    bool has_normal, has_uv, is_single[3];
};

static bool take_property(const struct ply_values *in, const struct ply_element *e, const char *name, int value,
                          struct vertex_layout *layout) {
    size_t k = ply_find_property(&in->header, e, name);
    if (k == SIZE_MAX || in->header.property[e->first + k].is_list)
        return false;
    layout->target[k] = (signed char)value;
    return true;
}

/* Names of texture coordinates as MeshLab, Blender and others write them; in integers they would be something else. */
static void find_vertex_uv(const struct ply_values *in, const struct ply_element *e, struct vertex_layout *layout) {
    static const char *const names[][2] = {{"s", "t"}, {"u", "v"}, {"texture_u", "texture_v"}};
    for (size_t i = 0; i < sizeof names / sizeof *names && !layout->has_uv; i++) {
        size_t k[2] = {ply_find_property(&in->header, e, names[i][0]), ply_find_property(&in->header, e, names[i][1])};
        const struct ply_property *p = &in->header.property[e->first];
        layout->has_uv = k[0] != SIZE_MAX && k[1] != SIZE_MAX && p[k[0]].type >= PLY_FLOAT32 &&
                         p[k[1]].type >= PLY_FLOAT32 && take_property(in, e, names[i][0], VERTEX_UV, layout) &&
                         take_property(in, e, names[i][1], VERTEX_UV + 1, layout);
    }
}

static enum status find_vertex_properties(const struct ply_values *in, const struct ply_element *e,
                                          struct vertex_layout *layout) {
    static const char *const wanted[VERTEX_UV] = {"x", "y", "z", "nx", "ny", "nz"};
    *layout = (struct vertex_layout){.has_normal = true};
    memset(layout->target, -1, sizeof layout->target);
    for (int i = 0; i < VERTEX_UV; i++) {
        bool usable = take_property(in, e, wanted[i], i, layout);
        if (!usable && i < VERTEX_NORMAL)
            return error_set(in->err, STATUS_INPUT, "%s: its vertices have no property %s", in->cursor.name, wanted[i]);
        layout->has_normal = layout->has_normal && usable;
        if (i < VERTEX_NORMAL)
            layout->is_single[i] =
                in->header.format != PLY_ASCII &&
                in->header.property[e->first + ply_find_property(&in->header, e, wanted[i])].type == PLY_FLOAT32;
    }
    find_vertex_uv(in, e, layout);
    return STATUS_OK;
}

enum status ply_read_vertices(struct ply_values *in, const struct ply_element *e, struct ply_vertices *vertices,
                              struct mesh *mesh) {
    struct vertex_layout layout;
    enum status status = find_vertex_properties(in, e, &layout);
    if (status == STATUS_OK)
        status = ply_begin_element(in, e);
    if (status != STATUS_OK)
        return status;
    if (e->count >= UINT32_MAX)
        return error_set(in->err, STATUS_LIMIT, "%s has %" PRIu64 " vertices, more than fit", in->cursor.name,
                         e->count);
    mesh->vertex_count = vertices->position.capacity = (size_t)e->count;
    vertices->position.at = mem_array(mesh->vertex_count, sizeof *vertices->position.at);
    if (layout.has_normal)
        mesh->normal = mem_array(mesh->vertex_count, sizeof *mesh->normal);
    if (layout.has_uv)
        vertices->uv = mem_array(mesh->vertex_count, sizeof *vertices->uv);
    for (size_t i = 0; i < mesh->vertex_count; i++) {
        double v[VERTEX_VALUES] = {0.0};
        status = ply_begin_record(in, i);
        for (size_t k = 0; status == STATUS_OK && k < e->property_count; k++) {
            const struct ply_property *p = &in->header.property[e->first + k];
            int target = layout.target[k];
            status = target >= 0 ? ply_read_value(in, p->type, &v[target]) : ply_skip_property(in, p);
        }
        if (status == STATUS_OK)
            status = ply_end_record(in);
        if (status != STATUS_OK)
            return status;
        positions_append(&vertices->position, v);
        for (int k = 0; k < 3; k++)
            vertices->position.single =
                layout.is_single[k] ? fmax(vertices->position.single, fabs(v[k])) : vertices->position.single;
        if (layout.has_normal)
            mesh->normal[i] = vec3_make((float)v[3], (float)v[4], (float)v[5]);
        if (layout.has_uv)
            vertices->uv[i] = (vec2){(float)v[VERTEX_UV], (float)v[VERTEX_UV + 1]};
    }
    return STATUS_OK;
}

void ply_vertices_release(struct ply_vertices *vertices) {
    positions_release(&vertices->position);
    mem_free(vertices->uv);
    vertices->uv = NULL;
}
