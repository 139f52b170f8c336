/* faces.c -- see faces.h. */
#include "server/ingest/faces.h"

#include "common/mem.h"

struct faces *faces_new(struct mesh *mesh, const char *name, size_t triangle_limit, bool has_object_id) {
    struct faces *f = mem_calloc(1, sizeof *f);
    f->mesh = mesh;
    f->name = name;
    f->limit = triangle_limit < MESH_MAX_TRIANGLES ? triangle_limit : MESH_MAX_TRIANGLES;
    f->has_object_id = has_object_id;
    return f;
}

void faces_reserve(struct faces *f, size_t wanted) {
    if (wanted <= f->capacity)
        return;
    struct mesh *mesh = f->mesh;
    size_t grown = f->capacity + f->capacity / 2;
    f->capacity = grown > wanted ? grown : wanted;
    mesh->index = mem_realloc_array(mesh->index, f->capacity, sizeof *mesh->index);
    mesh->face = mem_realloc_array(mesh->face, f->capacity, sizeof *mesh->face);
    if (f->has_object_id)
        mesh->object_id = mem_realloc_array(mesh->object_id, f->capacity, sizeof *mesh->object_id);
}

enum status faces_add(struct faces *f, int64_t object_id, struct error *err) {
    struct mesh *mesh = f->mesh;
    uint32_t face = (uint32_t)mesh->face_count++;
    if (f->corner_count < 3) {
        f->report.small_count++;
        return STATUS_OK;
    }
    f->report.polygon_count += f->corner_count > 4;
    size_t made = f->corner_count - 2;
    if (made > f->limit - mesh->triangle_count)
        return error_set(err, STATUS_LIMIT, "%s has more than %zu triangles, the limit", f->name, f->limit);
    faces_reserve(f, mesh->triangle_count + made);
    polygon_triangulate(f->position, f->corner_count, f->triangle);
    for (size_t i = 0; i < made; i++) {
        size_t at = mesh->triangle_count++;
        for (int k = 0; k < 3; k++)
            mesh->index[at][k] = f->corner[f->triangle[i][k]];
        mesh->face[at] = face;
        if (f->has_object_id)
            mesh->object_id[at] = object_id;
    }
    return STATUS_OK;
}
