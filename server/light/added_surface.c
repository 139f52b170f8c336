/* added_surface.c -- see added_surface.h. */
#include "server/light/added_surface.h"

#include "common/mem.h"

#define MAX_NAMED (1 << 20) /* ids from there on get no name: there is an array of them */

static void add_vertices(struct mesh *mesh, const vec3 corner[4]) {
    vec3 normal = vec3_normalize(vec3_cross(vec3_sub(corner[1], corner[0]), vec3_sub(corner[2], corner[0])));
    for (size_t k = 0; k < 4; k++) {
        mesh->position[mesh->vertex_count] = corner[k];
        if (mesh->normal)
            mesh->normal[mesh->vertex_count] = normal;
        mesh->vertex_count++;
    }
}

static void add_quad(struct mesh *mesh, struct segments *segments, const vec3 corner[4], int64_t id) {
    uint32_t first = (uint32_t)mesh->vertex_count;
    add_vertices(mesh, corner);
    for (uint32_t k = 0; k < ADDED_TRIANGLES; k++) {
        size_t t = mesh->triangle_count++;
        mesh->index[t][0] = first;
        mesh->index[t][1] = first + 1 + k;
        mesh->index[t][2] = first + 2 + k;
        mesh->face[t] = MESH_NO_FACE;
        if (mesh->object_id)
            mesh->object_id[t] = id;
        for (int c = 0; c < 3 && mesh->uv; c++)
            mesh->uv[t][c] = (vec2){NAN, NAN}; /* the input's picture has no place for it */
        segments->of_triangle[t] = (uint32_t)segments->count;
    }
}

/* Names an id where names are kept by id: of the segments, or of the input's objects. */
static void set_name(struct mesh *mesh, struct segments *segments, int64_t id, const char *called) {
    char ***name = segments->is_given ? &mesh->name : &segments->name;
    size_t *count = segments->is_given ? &mesh->name_count : &segments->name_count;
    if (id >= MAX_NAMED)
        return;
    if ((size_t)id >= *count)
        *name = mem_realloc_array(*name, (size_t)id + 1, sizeof **name);
    for (; *count <= (size_t)id; ++*count)
        (*name)[*count] = segments->is_given ? mem_strdup("") : NULL; /* what those without a name have */
    mem_free((*name)[id]);
    (*name)[id] = mem_strdup(called);
}

uint32_t added_surface_segment(struct reconstruction *r, const char *name, const vec3 (*corner)[4], size_t quads) {
    struct segments *segments = &r->segments;
    struct mesh *mesh = &r->scene->mesh;
    size_t triangles = mesh->triangle_count + ADDED_TRIANGLES * quads;
    int64_t id = -1;
    for (size_t i = 0; i < segments->count; i++)
        id = segments->id[i] > id ? segments->id[i] : id;
    mesh_reserve(mesh, 4 * quads, ADDED_TRIANGLES * quads);
    segments->of_triangle = mem_realloc_array(segments->of_triangle, triangles, sizeof *segments->of_triangle);
    segments->id = mem_realloc_array(segments->id, segments->count + 1, sizeof *segments->id);
    for (size_t i = 0; i < quads; i++)
        add_quad(mesh, segments, corner[i], id + 1);
    set_name(mesh, segments, id + 1, name);
    segments->id[segments->count] = id + 1;
    return (uint32_t)segments->count++;
}
