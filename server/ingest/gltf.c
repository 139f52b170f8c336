/* gltf.c -- see gltf.h. The nodes of a file form trees (glTF 2.0 specification, 3.5.2): each is visited at most once,
 * so cycles and nodes with several parents are harmless. */
#include "server/ingest/gltf.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/mem.h"
#include "common/rng.h"
#include "server/ingest/gltf_accessor.h"
#include "server/ingest/gltf_extensions.h"
#include "server/ingest/gltf_file.h"
#include "server/ingest/gltf_node.h"
#include "server/ingest/positions.h"

#define MAX_DEPTH 256 /* of nodes */
#define TRIANGLES 4
#define STRIP 5
#define FAN 6
#define NONE UINT32_MAX

struct gltf_reader {
    struct gltf_file file;
    struct mesh *mesh;
    struct faces *faces;
    struct positions position;
    size_t normal_capacity;
    bool lacks_normals; /* a primitive without normals */
    bool *visited;      /* [nodes.count]; owned */
    int64_t object_count;
    size_t skinned_count, morphed_count, hidden_count; /* nodes, primitives, nodes */
    struct error *err;
};

/* --- primitives (3.7.2) --------------------------------------------------------------------- */

static enum status open_attribute(struct gltf_reader *r, const cJSON *primitive, const char *key, const char *where,
                                  bool *found, struct gltf_span *span) {
    const cJSON *attributes = cJSON_GetObjectItemCaseSensitive(primitive, "attributes");
    size_t accessor;
    enum status status = gltf_index(&r->file, attributes, key, where, &r->file.accessors, found, &accessor, r->err);
    if (status == STATUS_OK && *found)
        status = gltf_span(&r->file, accessor, "VEC3", span, r->err);
    if (status == STATUS_OK && *found && span->component == GLTF_UINT) /* KHR_mesh_quantization: up to 16 bits */
        status = error_set(r->err, STATUS_INPUT, "%s: accessors[%zu] of %s.%s holds neither floats nor short integers",
                           r->file.name, accessor, where, key);
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
    size_t table_size;
    uint32_t (*table)[2]; /* [table_size] index in the file, and in the mesh or NONE; owned */
};

static vec3 apply(const double m[3], const double m1[3], const double m2[3], const double v[3]) {
    double x = v[0], y = v[1], z = v[2];
    return (vec3){(float)(m[0] * x + m[1] * y + m[2] * z), (float)(m1[0] * x + m1[1] * y + m1[2] * z),
                  (float)(m2[0] * x + m2[1] * y + m2[2] * z)};
}

static uint32_t append_vertex(struct gltf_reader *r, const struct primitive *p, size_t number) {
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
static uint32_t vertex_of(struct gltf_reader *r, const struct primitive *p, size_t number) {
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
    corner[0] = mode == TRIANGLES ? 3 * i : mode == STRIP ? i : i + 1;
    corner[1] = mode == TRIANGLES ? 3 * i + 1 : mode == STRIP ? i + 1 + i % 2 : i + 2;
    corner[2] = mode == TRIANGLES ? 3 * i + 2 : mode == STRIP ? i + 2 - i % 2 : 0;
}

static enum status add_triangles(struct gltf_reader *r, const struct primitive *p, size_t triangles) {
    struct faces *f = r->faces;
    f->corner_count = 3;
    for (size_t i = 0; i < triangles; i++) {
        size_t corner[3];
        corners_of(p->mode, i, corner);
        for (int k = 0; k < 3; k++) {
            size_t at = corner[p->mirrored ? 2 - k : k];
            size_t vertex = p->is_indexed ? gltf_read_index(&p->indices, at) : at;
            if (vertex >= p->position.count)
                return error_set(r->err, STATUS_INPUT, "%s: %s refers to vertex %zu, but there are %zu", r->file.name,
                                 p->where, vertex, p->position.count);
            f->corner[k] = vertex_of(r, p, vertex);
            memcpy(f->position[k], r->position.at[f->corner[k]], sizeof f->position[k]);
        }
        enum status status = faces_add(f, r->object_count - 1, r->err);
        if (status != STATUS_OK)
            return status;
    }
    return STATUS_OK;
}

static enum status open_primitive(struct gltf_reader *r, const cJSON *object, struct primitive *p) {
    size_t accessor;
    bool found;
    const cJSON *extensions = cJSON_GetObjectItemCaseSensitive(object, "extensions");
    if (cJSON_GetObjectItemCaseSensitive(extensions, "KHR_draco_mesh_compression")) {
        error_set(r->err, STATUS_INPUT, "%s: %s is compressed by Draco, which is not read", r->file.name, p->where);
        return error_hint(r->err, "export it without compression");
    }
    r->morphed_count += cJSON_GetArraySize(cJSON_GetObjectItemCaseSensitive(object, "targets")) > 0;
    enum status status =
        gltf_index(&r->file, object, "indices", p->where, &r->file.accessors, &p->is_indexed, &accessor, r->err);
    if (status == STATUS_OK && p->is_indexed)
        status = gltf_span(&r->file, accessor, "SCALAR", &p->indices, r->err);
    enum gltf_component c = p->indices.component;
    if (status == STATUS_OK && p->is_indexed && c != GLTF_UBYTE && c != GLTF_USHORT && c != GLTF_UINT)
        status =
            error_set(r->err, STATUS_INPUT, "%s: the indices of %s are not unsigned integers", r->file.name, p->where);
    if (status == STATUS_OK)
        status = open_attribute(r, object, "POSITION", p->where, &found, &p->position);
    if (status == STATUS_OK && !found)
        status = error_set(r->err, STATUS_INPUT, "%s: %s has no POSITION", r->file.name, p->where);
    if (status == STATUS_OK)
        status = open_attribute(r, object, "NORMAL", p->where, &p->has_normal, &p->normal);
    if (status == STATUS_OK && p->has_normal && p->normal.count != p->position.count)
        status = error_set(r->err, STATUS_INPUT, "%s: %s has %zu positions and %zu normals", r->file.name, p->where,
                           p->position.count, p->normal.count);
    return status;
}

static void release_primitive(struct primitive *p) {
    gltf_span_release(&p->position);
    gltf_span_release(&p->normal);
    gltf_span_release(&p->indices);
}

static enum status add_primitive(struct gltf_reader *r, const cJSON *object, const char *where, int mode,
                                 const struct affine *t) {
    struct primitive p = {.where = where, .mode = mode, .t = t};
    enum status status = open_primitive(r, object, &p);
    if (status != STATUS_OK) {
        release_primitive(&p);
        return status;
    }
    size_t count = p.is_indexed ? p.indices.count : p.position.count;
    size_t triangles = mode == TRIANGLES ? count / 3 : count < 3 ? 0 : count - 2;
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

/* Each change of material within the node starts an object. */
static enum status add_mesh(struct gltf_reader *r, size_t mesh, const struct affine *t) {
    const cJSON *primitives = cJSON_GetObjectItemCaseSensitive(r->file.meshes.item[mesh], "primitives"), *item;
    double material = NAN; /* -1: none */
    size_t i = 0;
    enum status status = STATUS_OK;
    cJSON_ArrayForEach(item, primitives) {
        const cJSON *mode = cJSON_GetObjectItemCaseSensitive(item, "mode");
        const cJSON *own = cJSON_GetObjectItemCaseSensitive(item, "material");
        double kind = mode ? cJSON_GetNumberValue(mode) : TRIANGLES;
        double number = own ? cJSON_GetNumberValue(own) : -1.0;
        char where[64];
        snprintf(where, sizeof where, "meshes[%zu].primitives[%zu]", mesh, i++);
        if (kind != TRIANGLES && kind != STRIP && kind != FAN)
            continue;
        if (!(number == material))
            r->object_count++;
        material = number;
        status = add_primitive(r, item, where, (int)kind, t);
        if (status != STATUS_OK)
            return status;
    }
    return STATUS_OK;
}

/* --- nodes ---------------------------------------------------------------------------------- */

/* The mesh of a node, once or as often as the node says. */
static enum status add_instances(struct gltf_reader *r, size_t node, size_t mesh, const struct affine *t) {
    const cJSON *object = r->file.nodes.item[node];
    const cJSON *instancing = gltf_extension(object, "EXT_mesh_gpu_instancing");
    struct affine *instance;
    size_t count;
    r->skinned_count += cJSON_GetObjectItemCaseSensitive(object, "skin") != NULL;
    if (!instancing)
        return add_mesh(r, mesh, t);
    enum status status = gltf_node_instances(&r->file, node, instancing, &instance, &count, r->err);
    for (size_t i = 0; i < count && status == STATUS_OK; i++) {
        struct affine own = affine_multiply(t, &instance[i]);
        status = add_mesh(r, mesh, &own);
    }
    mem_free(instance);
    return status;
}

/* KHR_node_visibility: neither it nor its children are seen. */
static bool is_hidden(const cJSON *node) {
    return cJSON_IsFalse(cJSON_GetObjectItemCaseSensitive(gltf_extension(node, "KHR_node_visibility"), "visible"));
}

static enum status visit(struct gltf_reader *r, size_t node, const struct affine *parent, int depth) {
    const cJSON *object = r->file.nodes.item[node], *item;
    struct affine own, t;
    char where[48];
    size_t mesh;
    bool found;
    snprintf(where, sizeof where, "nodes[%zu]", node);
    if (r->visited[node])
        return error_set(r->err, STATUS_INPUT, "%s: %s has more than one parent", r->file.name, where);
    if (depth > MAX_DEPTH)
        return error_set(r->err, STATUS_INPUT, "%s: %s lies more than %d nodes deep", r->file.name, where, MAX_DEPTH);
    r->visited[node] = true;
    enum status status = gltf_node_transform(&r->file, node, &own, r->err);
    if (status == STATUS_OK)
        status = gltf_index(&r->file, object, "mesh", where, &r->file.meshes, &found, &mesh, r->err);
    if (status != STATUS_OK)
        return status;
    if (is_hidden(object)) {
        r->hidden_count++;
        return STATUS_OK;
    }
    t = affine_multiply(parent, &own);
    if (found)
        status = add_instances(r, node, mesh, &t);
    cJSON_ArrayForEach(item, cJSON_GetObjectItemCaseSensitive(object, "children")) {
        double child = cJSON_GetNumberValue(item);
        if (status != STATUS_OK)
            break;
        if (!(child >= 0.0 && child < (double)r->file.nodes.count) || child != floor(child))
            return error_set(r->err, STATUS_INPUT, "%s: a child of %s is none of the %zu nodes", r->file.name, where,
                             r->file.nodes.count);
        status = visit(r, (size_t)child, &t, depth + 1);
    }
    return status;
}

static enum status visit_list(struct gltf_reader *r, const cJSON *list, const char *of) {
    static const struct affine identity = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    const cJSON *item;
    cJSON_ArrayForEach(item, list) {
        double node = cJSON_GetNumberValue(item);
        if (!(node >= 0.0 && node < (double)r->file.nodes.count) || node != floor(node))
            return error_set(r->err, STATUS_INPUT, "%s: a node of %s is none of the %zu nodes", r->file.name, of,
                             r->file.nodes.count);
        enum status status = visit(r, (size_t)node, &identity, 0);
        if (status != STATUS_OK)
            return status;
    }
    return STATUS_OK;
}

/* All nodes that are no child. */
static enum status visit_roots(struct gltf_reader *r) {
    cJSON *roots = cJSON_CreateArray();
    bool *is_child = mem_calloc(r->file.nodes.count + 1, sizeof *is_child);
    const cJSON *item;
    for (size_t i = 0; i < r->file.nodes.count; i++) {
        cJSON_ArrayForEach(item, cJSON_GetObjectItemCaseSensitive(r->file.nodes.item[i], "children")) {
            double child = cJSON_GetNumberValue(item);
            if (child >= 0.0 && child < (double)r->file.nodes.count)
                is_child[(size_t)child] = true;
        }
    }
    for (size_t i = 0; i < r->file.nodes.count; i++)
        if (!is_child[i])
            cJSON_AddItemToArray(roots, cJSON_CreateNumber((double)i));
    enum status status = visit_list(r, roots, "all");
    mem_free(is_child);
    cJSON_Delete(roots);
    return status;
}

static enum status read_scene(struct gltf_reader *r) {
    bool found;
    size_t scene;
    enum status status =
        gltf_index(&r->file, r->file.json, "scene", "the file", &r->file.scenes, &found, &scene, r->err);
    if (status != STATUS_OK)
        return status;
    r->visited = mem_calloc(r->file.nodes.count + 1, sizeof *r->visited);
    if (r->file.scenes.count == 0)
        return visit_roots(r);
    return visit_list(r, cJSON_GetObjectItemCaseSensitive(r->file.scenes.item[scene], "nodes"), "the scene");
}

static void take_notes(struct gltf_reader *r) {
    struct faces_report *report = &r->faces->report;
    const char *unknown = gltf_extensions_unknown(&r->file);
    if (unknown)
        faces_note(report, "it uses the extension %.64s, which was not read", unknown);
    if (r->skinned_count > 0)
        faces_note(report,
                   "%zu nodes are skinned: their meshes were read as stored, in the pose that they were bound in",
                   r->skinned_count);
    if (r->morphed_count > 0)
        faces_note(report, "%zu primitives have morph targets, which were left out", r->morphed_count);
    if (r->hidden_count > 0)
        faces_note(report, "%zu nodes are hidden and were left out", r->hidden_count);
}

static void finish(struct gltf_reader *r) {
    struct mesh *mesh = r->mesh;
    r->faces->report.step_m = positions_step(r->position.single);
    positions_settle(&r->position, mesh);
    if (r->lacks_normals) {
        mem_free(mesh->normal);
        mesh->normal = NULL;
    }
    if (r->object_count < 2) {
        mem_free(mesh->object_id);
        mesh->object_id = NULL;
    }
}

enum status gltf_parse(const void *data, size_t size, const char *name, const char *folder, size_t triangle_limit,
                       struct mesh *mesh, struct faces_report *report, struct error *err) {
    *mesh = (struct mesh){0};
    struct gltf_reader r = {.mesh = mesh, .err = err};
    r.faces = faces_new(mesh, name, triangle_limit, true);
    enum status status = gltf_file_open(&r.file, data, size, name, folder, err);
    if (status == STATUS_OK)
        status = gltf_extensions_check(&r.file, err);
    if (status == STATUS_OK)
        status = read_scene(&r);
    if (status == STATUS_OK && mesh->triangle_count == 0)
        status = error_set(err, STATUS_INPUT, "%s has no triangles in its scene", name);
    if (status == STATUS_OK)
        take_notes(&r);
    if (status == STATUS_OK)
        finish(&r);
    else
        mesh_release(mesh);
    if (report)
        *report = r.faces->report;
    gltf_file_release(&r.file);
    positions_release(&r.position);
    mem_free(r.visited);
    mem_free(r.faces);
    return status;
}

enum status gltf_read(const char *path, const char *name, size_t triangle_limit, struct mesh *mesh,
                      struct faces_report *report, struct error *err) {
    struct mapping file;
    const char *slash = strrchr(path, '/');
    char *folder = slash ? mem_strndup(path, (size_t)(slash - path)) : mem_strdup(".");
    *mesh = (struct mesh){0};
    enum status status = mapping_open(&file, path, name, "a glTF file", err);
    if (status == STATUS_OK)
        status = gltf_parse(file.data, file.size, name, folder, triangle_limit, mesh, report, err);
    mapping_close(&file);
    mem_free(folder);
    return status;
}
