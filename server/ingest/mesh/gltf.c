/* gltf.c -- see gltf.h. The nodes of a file form trees (glTF 2.0 specification, 3.5.2): each is visited at most once,
 * so cycles and nodes with several parents are harmless. */
#include "server/ingest/mesh/gltf.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/mem.h"
#include "server/ingest/mesh/gltf_extensions.h"
#include "server/ingest/mesh/gltf_file.h"
#include "server/ingest/mesh/gltf_materials.h"
#include "server/ingest/mesh/gltf_node.h"
#include "server/ingest/mesh/gltf_objects.h"
#include "server/ingest/mesh/gltf_primitive.h"
#include "server/ingest/mesh/gltf_uv.h"

#define MAX_DEPTH 256 /* of nodes */

struct gltf_reader {
    struct gltf_file file;
    struct gltf_surface surface;
    struct gltf_objects objects;
    bool *visited; /* [nodes.count]; owned */
    bool *shown;   /* [images] whether one is a base colour; owned */
    int image_count;
    size_t skinned_count, hidden_count; /* nodes */
    struct mesh_materials *materials;   /* NULL: materials are not read */
    bool *is_used;                      /* [materials + 1] whether a primitive has the material; owned */
    struct error *err;
};

/* --- meshes --------------------------------------------------------------------------------- */

/* Of a primitive with that material, -1: none, where materials are read. */
static enum status use_material(struct gltf_reader *r, const char *where, double material) {
    size_t count = gltf_materials_count(&r->file), number = material >= 0.0 ? (size_t)material : count;
    if (!(material < (double)count) || (material >= 0.0 && material != floor(material)))
        return error_set(r->err, STATUS_INPUT, "%s: the material of %s is none of the %zu", r->file.name, where, count);
    r->is_used[number] = true;
    r->surface.object_id = (int64_t)number;
    r->surface.uv_set = -1;
    return number < count ? gltf_materials_uv_set(&r->file, number, &r->surface.uv_set, r->err) : STATUS_OK;
}

/* Each change of material within the node starts an object. */
static enum status add_mesh(struct gltf_reader *r, size_t node, size_t mesh, const struct affine *t) {
    const cJSON *primitives = cJSON_GetObjectItemCaseSensitive(r->file.meshes.item[mesh], "primitives"), *item;
    double material = NAN; /* -1: none */
    bool is_first = true;
    size_t i = 0;
    enum status status = STATUS_OK;
    cJSON_ArrayForEach(item, primitives) {
        const cJSON *mode = cJSON_GetObjectItemCaseSensitive(item, "mode");
        const cJSON *own = cJSON_GetObjectItemCaseSensitive(item, "material");
        double kind = mode ? cJSON_GetNumberValue(mode) : (double)GLTF_TRIANGLES;
        double number = own ? cJSON_GetNumberValue(own) : -1.0;
        char where[64];
        snprintf(where, sizeof where, "meshes[%zu].primitives[%zu]", mesh, i++);
        if (kind != (double)GLTF_TRIANGLES && kind != (double)GLTF_STRIP && kind != (double)GLTF_FAN)
            continue;
        if (is_first || (number != material && !r->objects.are_pages))
            gltf_objects_start(&r->objects, node, mesh, number);
        is_first = false;
        material = number;
        r->surface.object_id = (int64_t)r->objects.count - 1;
        int picture = gltf_uv_picture(&r->file, item);
        if (picture >= 0 && picture < r->image_count)
            r->shown[picture] = true;
        if (r->materials)
            status = use_material(r, where, number);
        if (status == STATUS_OK)
            status = gltf_surface_add(&r->surface, item, where, (int)kind, t);
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
        return add_mesh(r, node, mesh, t);
    enum status status = gltf_node_instances(&r->file, node, instancing, &instance, &count, r->err);
    for (size_t i = 0; i < count && status == STATUS_OK; i++) {
        struct affine own = affine_multiply(t, &instance[i]);
        status = add_mesh(r, node, mesh, &own);
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
    struct faces_report *report = &r->surface.faces->report;
    const char *unknown = gltf_extensions_unknown(&r->file);
    if (unknown)
        faces_note(report, "it uses the extension %.64s, which was not read", unknown);
    if (r->skinned_count > 0)
        faces_note(report,
                   "%zu nodes are skinned: their meshes were read as stored, in the pose that they were bound in",
                   r->skinned_count);
    if (r->surface.morphed_count > 0)
        faces_note(report, "%zu primitives have morph targets, which were left out", r->surface.morphed_count);
    if (r->surface.no_uv_count > 0)
        faces_note(report, "%zu primitives have texture coordinates that cannot be read and were left out",
                   r->surface.no_uv_count);
    if (r->hidden_count > 0)
        faces_note(report, "%zu nodes are hidden and were left out", r->hidden_count);
    if (r->materials && r->surface.colored_count > 0)
        faces_note(report, "%zu primitives have colours of their vertices, which were left out",
                   r->surface.colored_count);
    if (r->materials)
        mesh_materials_note(r->materials, report);
}

static void finish(struct gltf_reader *r) {
    struct gltf_surface *surface = &r->surface;
    struct mesh *mesh = surface->mesh;
    surface->faces->report.step_m = positions_step(surface->position.single);
    positions_move_to_mesh(&surface->position, mesh);
    if (surface->lacks_normals) {
        mem_free(mesh->normal);
        mesh->normal = NULL;
    }
    if (!r->materials)
        gltf_objects_settle(&r->objects, mesh, &surface->faces->report);
    for (int i = 0; i < r->image_count; i++)
        mesh->picture_count += r->shown[i];
    take_notes(r);
}

enum status gltf_parse(const void *data, size_t size, const char *name, const char *folder, size_t triangle_limit,
                       struct mesh *mesh, struct mesh_materials *materials, struct faces_report *report,
                       struct error *err) {
    *mesh = (struct mesh){0};
    struct gltf_reader r = {.materials = materials, .err = err};
    r.surface = (struct gltf_surface){.file = &r.file, .mesh = mesh, .with_materials = materials != NULL, .err = err};
    r.surface.faces = faces_new(mesh, name, triangle_limit, true);
    enum status status = gltf_file_open(&r.file, data, size, name, folder, err);
    if (status == STATUS_OK)
        status = gltf_extensions_check(&r.file, err);
    if (status == STATUS_OK) {
        gltf_objects_init(&r.objects, &r.file);
        r.is_used = mem_calloc(gltf_materials_count(&r.file) + 1, sizeof *r.is_used);
        r.image_count = cJSON_GetArraySize(cJSON_GetObjectItemCaseSensitive(r.file.json, "images"));
        r.shown = mem_calloc((size_t)r.image_count + 1, sizeof *r.shown);
        status = read_scene(&r);
    }
    if (status == STATUS_OK && mesh->triangle_count == 0)
        status = error_set(err, STATUS_INPUT, "%s has no triangles in its scene", name);
    if (status == STATUS_OK && materials)
        status = gltf_materials_read(&r.file, r.is_used, materials, err);
    if (status == STATUS_OK)
        finish(&r);
    else
        mesh_release(mesh);
    if (report)
        *report = r.surface.faces->report;
    gltf_objects_release(&r.objects);
    gltf_file_release(&r.file);
    positions_release(&r.surface.position);
    mem_free(r.is_used);
    mem_free(r.visited);
    mem_free(r.shown);
    mem_free(r.surface.faces);
    return status;
}
