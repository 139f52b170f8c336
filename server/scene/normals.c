/* normals.c -- see normals.h. */
#include "server/scene/normals.h"

#include "common/mem.h"
#include "server/scene/face_normals.h"

#define EDGE_COSINE 0.8f      /* between filtered normals; below it there is an edge */
#define FLAT_DIFFERENCE 1e-6f /* 1 - cosine to the triangle's own normal that counts as equal */

/* The vertices being built. */
struct vertices {
    size_t count, capacity;
    vec3 *position, *normal;
    bool differs; /* some normal differs from that of its triangle */
};

static uint32_t add_vertex(struct vertices *v, vec3 position, vec3 normal) {
    if (v->count == v->capacity) {
        v->capacity = 2 * v->capacity + 64;
        v->position = mem_realloc_array(v->position, v->capacity, sizeof *v->position);
        v->normal = mem_realloc_array(v->normal, v->capacity, sizeof *v->normal);
    }
    v->position[v->count] = position;
    v->normal[v->count] = normal;
    return (uint32_t)v->count++;
}

static int corner_at(const struct face_normals *f, const struct mesh *mesh, size_t t, size_t vertex) {
    int c = 0;
    while (f->weld[mesh->index[t][c]] != vertex)
        c++;
    return c;
}

/* Splits one welded vertex: each of its triangles joins the first new vertex whose normal is not across an edge. Sets
 * `index` of the triangles' corners. */
static void make_vertices(const struct face_normals *f, const struct mesh *mesh, size_t vertex, struct vertices *v,
                          uint32_t (*index)[3]) {
    size_t begin = v->count;
    const uint32_t *first = &f->triangle[f->first[vertex]], *end = &f->triangle[f->first[vertex + 1]];
    for (const uint32_t *t = first; t < end; t++) {
        size_t i = begin;
        while (i < v->count && vec3_dot(vec3_normalize(v->normal[i]), f->normal[*t]) < EDGE_COSINE)
            i++;
        vec3 part = vec3_scale(f->normal[*t], f->area[*t]);
        if (i == v->count)
            add_vertex(v, mesh->position[vertex], part);
        else
            v->normal[i] = vec3_add(v->normal[i], part);
        index[*t][corner_at(f, mesh, *t, vertex)] = (uint32_t)i;
    }
    for (size_t i = begin; i < v->count; i++)
        v->normal[i] = vec3_normalize(v->normal[i]);
    for (const uint32_t *t = first; t < end; t++) {
        vec3 own = vec3_normalize(mesh_cross(mesh, *t));
        uint32_t corner = index[*t][corner_at(f, mesh, *t, vertex)];
        v->differs = v->differs || vec3_dot(own, v->normal[corner]) < 1.0f - FLAT_DIFFERENCE;
    }
}

/* Installs the new vertices in the mesh, or frees them if no normal differs from its triangle's. */
static bool move_vertices(struct mesh *mesh, struct vertices *v, uint32_t (*index)[3]) {
    if (!v->differs) {
        mem_free(v->position);
        mem_free(v->normal);
        mem_free(index);
        return false;
    }
    mem_free(mesh->position);
    mem_free(mesh->index);
    mesh->vertex_count = v->count;
    mesh->position = v->position;
    mesh->normal = v->normal;
    mesh->index = index;
    return true;
}

bool normals_estimate(struct mesh *mesh, struct parallel *pool, float *roughness) {
    *roughness = 0.0f;
    if (mesh->normal)
        return true;
    struct face_normals faces;
    struct vertices vertices = {0};
    uint32_t(*index)[3] = mem_array(mesh->triangle_count, sizeof *index);
    face_normals_init(&faces, mesh, pool);
    *roughness = faces.roughness;
    for (size_t v = 0; v < mesh->vertex_count; v++)
        make_vertices(&faces, mesh, v, &vertices, index);
    face_normals_release(&faces);
    return move_vertices(mesh, &vertices, index);
}
