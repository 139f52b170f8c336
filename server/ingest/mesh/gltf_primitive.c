/* gltf_primitive.c -- see gltf_primitive.h. Sections are those of the glTF 2.0 specification. */
#include "server/ingest/mesh/gltf_primitive.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "common/rng.h"
#include "server/ingest/mesh/gltf_accessor.h"
#include "server/ingest/mesh/gltf_uv.h"

#define NONE UINT32_MAX /* no vertex */

static enum status open_attribute(struct gltf_surface *r, const cJSON *primitive, const char *key, const char *where,
                                  bool *found, struct gltf_span *span) {
    const cJSON *attributes = cJSON_GetObjectItemCaseSensitive(primitive, "attributes");
    size_t accessor;
    enum status status = gltf_index(r->file, attributes, key, where, &r->file->accessors, found, &accessor, r->err);
    if (status == STATUS_OK && *found)
        status = gltf_span(r->file, accessor, "VEC3", span, r->err);
    if (status == STATUS_OK && *found && span->component == GLTF_UINT) /* KHR_mesh_quantization: up to 16 bits */
        status = error_set(r->err, STATUS_INPUT, "%s: accessors[%zu] of %s.%s holds neither floats nor short integers",
                           r->file->name, accessor, where, key);
    return status;
}

/* A primitive being added to the mesh. Only vertices used by its triangles are added, since primitives may share
 * large arrays. */
struct primitive {
    const char *where; /* for messages */
    int mode;
    const struct affine *t;
    double normal_matrix[3][3]; /* inverse transpose of the transform, for normals */
    bool mirrored, has_normal, is_indexed;
    struct gltf_span position, normal, indices;
    struct gltf_uv uv;
    size_t table_size;
    uint32_t (*table)[2]; /* [table_size] index in the file, and in the mesh or NONE; owned */
};

static vec3 apply(const double m[3], const double m1[3], const double m2[3], const double v[3]) {
    double x = v[0], y = v[1], z = v[2];
    return (vec3){(float)(m[0] * x + m[1] * y + m[2] * z), (float)(m1[0] * x + m1[1] * y + m1[2] * z),
                  (float)(m2[0] * x + m2[1] * y + m2[2] * z)};
}

static uint32_t append_vertex(struct gltf_surface *r, const struct primitive *p, size_t number) {
    struct mesh *mesh = r->mesh;
    const struct affine *t = p->t;
    double value[3];
    if (mesh->vertex_count == r->normal_capacity) {
        r->normal_capacity = r->normal_capacity ? r->normal_capacity + r->normal_capacity / 2 : 1024;
        mesh->normal = mem_realloc_array(mesh->normal, r->normal_capacity, sizeof *mesh->normal);
    }
    gltf_read_vector(&p->position, number, 3, value);
    double at[3];
    for (int i = 0; i < 3; i++) {
        double turned = t->m[i][0] * value[0] + t->m[i][1] * value[1] + t->m[i][2] * value[2];
        if (p->position.component == GLTF_FLOAT)
            r->position.single = fmax(r->position.single, fabs(turned));
        at[i] = turned + t->m[i][3];
    }
    positions_append(&r->position, at);
    vec3 normal = {0.0f, 0.0f, 0.0f};
    if (p->has_normal) {
        gltf_read_vector(&p->normal, number, 3, value);
        normal = apply(p->normal_matrix[0], p->normal_matrix[1], p->normal_matrix[2], value);
    }
    mesh->normal[mesh->vertex_count] = p->mirrored ? vec3_neg(normal) : normal;
    return (uint32_t)mesh->vertex_count++;
}

/* The mesh vertex for vertex `number` of the file, added on first use. */
static uint32_t vertex_of(struct gltf_surface *r, const struct primitive *p, size_t number) {
    size_t slot = rng_mix64(number) & (p->table_size - 1);
    for (; p->table[slot][1] != NONE; slot = (slot + 1) & (p->table_size - 1))
        if (p->table[slot][0] == (uint32_t)number)
            return p->table[slot][1];
    p->table[slot][0] = (uint32_t)number;
    p->table[slot][1] = append_vertex(r, p, number);
    return p->table[slot][1];
}

/* The corners of triangle i among the primitive's indices (3.7.2.1). */
static void corners_of(int mode, size_t i, size_t corner[3]) {
    corner[0] = mode == GLTF_TRIANGLES ? 3 * i : mode == GLTF_STRIP ? i : i + 1;
    corner[1] = mode == GLTF_TRIANGLES ? 3 * i + 1 : mode == GLTF_STRIP ? i + 1 + i % 2 : i + 2;
    corner[2] = mode == GLTF_TRIANGLES ? 3 * i + 2 : mode == GLTF_STRIP ? i + 2 - i % 2 : 0;
}

static enum status add_triangles(struct gltf_surface *r, const struct primitive *p, size_t triangles) {
    struct faces *f = r->faces;
    f->corner_count = 3;
    for (size_t i = 0; i < triangles; i++) {
        size_t corner[3];
        corners_of(p->mode, i, corner);
        for (int k = 0; k < 3; k++) {
            size_t at = corner[p->mirrored ? 2 - k : k];
            size_t vertex = p->is_indexed ? gltf_read_index(&p->indices, at) : at;
            if (vertex >= p->position.count)
                return error_set(r->err, STATUS_INPUT, "%s: %s refers to vertex %zu, but there are %zu", r->file->name,
                                 p->where, vertex, p->position.count);
            f->corner[k] = vertex_of(r, p, vertex);
            memcpy(f->position[k], r->position.at[f->corner[k]], sizeof f->position[k]);
            if (p->uv.is_there)
                f->uv[k] = gltf_uv_read(&p->uv, vertex);
        }
        f->has_uv = p->uv.is_there;
        enum status status = faces_add(f, r->object_id, r->err);
        if (status != STATUS_OK)
            return status;
    }
    return STATUS_OK;
}

static enum status open_uv(struct gltf_surface *r, const cJSON *object, struct primitive *p) {
    size_t count = p->position.count;
    const cJSON *attributes = cJSON_GetObjectItemCaseSensitive(object, "attributes");
    r->colored_count += cJSON_GetObjectItemCaseSensitive(attributes, "COLOR_0") != NULL;
    if (!r->with_materials) /* geometry does not need them */
        r->no_uv_count += gltf_uv_open(&p->uv, r->file, object, p->where, count, NULL) != STATUS_OK;
    if (!r->with_materials || r->uv_set < 0)
        return STATUS_OK;
    enum status status = gltf_uv_open_set(&p->uv, r->file, object, r->uv_set, p->where, count, r->err);
    if (status == STATUS_OK && !p->uv.is_there)
        status = error_set(r->err, STATUS_INPUT, "%s: %s has no TEXCOORD_%d, which the pictures of its material need",
                           r->file->name, p->where, r->uv_set);
    return status;
}

static enum status open_primitive(struct gltf_surface *r, const cJSON *object, struct primitive *p) {
    size_t accessor;
    bool found;
    const cJSON *extensions = cJSON_GetObjectItemCaseSensitive(object, "extensions");
    if (cJSON_GetObjectItemCaseSensitive(extensions, "KHR_draco_mesh_compression")) {
        error_set(r->err, STATUS_INPUT, "%s: %s is compressed by Draco, which is not read", r->file->name, p->where);
        return error_hint(r->err, "export it without compression");
    }
    r->morphed_count += cJSON_GetArraySize(cJSON_GetObjectItemCaseSensitive(object, "targets")) > 0;
    enum status status =
        gltf_index(r->file, object, "indices", p->where, &r->file->accessors, &p->is_indexed, &accessor, r->err);
    if (status == STATUS_OK && p->is_indexed)
        status = gltf_span(r->file, accessor, "SCALAR", &p->indices, r->err);
    enum gltf_component c = p->indices.component;
    if (status == STATUS_OK && p->is_indexed && c != GLTF_UBYTE && c != GLTF_USHORT && c != GLTF_UINT)
        status =
            error_set(r->err, STATUS_INPUT, "%s: the indices of %s are not unsigned integers", r->file->name, p->where);
    if (status == STATUS_OK)
        status = open_attribute(r, object, "POSITION", p->where, &found, &p->position);
    if (status == STATUS_OK && !found)
        status = error_set(r->err, STATUS_INPUT, "%s: %s has no POSITION", r->file->name, p->where);
    if (status == STATUS_OK)
        status = open_attribute(r, object, "NORMAL", p->where, &p->has_normal, &p->normal);
    if (status == STATUS_OK && p->has_normal && p->normal.count != p->position.count)
        status = error_set(r->err, STATUS_INPUT, "%s: %s has %zu positions and %zu normals", r->file->name, p->where,
                           p->position.count, p->normal.count);
    return status == STATUS_OK ? open_uv(r, object, p) : status;
}

static void release_primitive(struct primitive *p) {
    gltf_span_release(&p->position);
    gltf_span_release(&p->normal);
    gltf_span_release(&p->indices);
    gltf_uv_release(&p->uv);
}

enum status gltf_surface_add(struct gltf_surface *r, const cJSON *object, const char *where, int mode,
                             const struct affine *t) {
    struct primitive p = {.where = where, .mode = mode, .t = t};
    enum status status = open_primitive(r, object, &p);
    if (status != STATUS_OK) {
        release_primitive(&p);
        return status;
    }
    size_t count = p.is_indexed ? p.indices.count : p.position.count;
    size_t triangles = mode == GLTF_TRIANGLES ? count / 3 : count < 3 ? 0 : count - 2;
    affine_cofactors(t, p.normal_matrix);
    const double *first = p.normal_matrix[0];
    p.mirrored = t->m[0][0] * first[0] + t->m[0][1] * first[1] + t->m[0][2] * first[2] < 0.0;
    size_t most = count < p.position.count ? count : p.position.count;
    for (p.table_size = 16; p.table_size < 2 * most;)
        p.table_size *= 2;
    p.table = mem_array(p.table_size, sizeof *p.table);
    memset(p.table, 0xff, p.table_size * sizeof *p.table);
    r->lacks_normals = r->lacks_normals || !p.has_normal;
    status = add_triangles(r, &p, triangles);
    mem_free(p.table);
    release_primitive(&p);
    return status;
}
