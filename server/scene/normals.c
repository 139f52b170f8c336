/* normals.c -- see normals.h. */
#include "server/scene/normals.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "common/quantile.h"

#define CHUNK 1024 /* triangles a work item */
/* Passes of the filter; a mesh less rough than this is not filtered. */
#define PASSES 5
#define SMOOTH 0.005f
/* Normals that differ by this many times the roughness count .6, within bounds. */
#define ALIKE 2.0f
#define LEAST_ALIKE 0.15f
#define MOST_ALIKE 0.4f
/* Cosine of the angle between filtered normals from which there is an edge. */
#define EDGE_COSINE 0.8f
#define NEIGHBOURS_MOST 64 /* of a triangle that are looked at; more meet at the poles of spheres only */
#define SAMPLES_MOST 65536 /* triangles of which roughness is taken */
#define FLAT 1e-6f         /* a normal this near to the triangle's is the same */

struct triangles_at { /* triangles at each welded vertex */
    uint32_t *first;  /* [vertex_count + 1] */
    uint32_t *triangle;
};

struct filter {
    const struct mesh *mesh;
    const uint32_t *weld;
    struct triangles_at at;
    float *area;          /* [triangle_count] twice the area */
    vec3 *normal, *next;  /* [triangle_count] unit */
    float spread;
};

/* --- neighbours --------------------------------------------------------------------------------- */

static void collect_triangles(struct filter *f) {
    const struct mesh *m = f->mesh;
    f->at.first = mem_calloc(m->vertex_count + 1, sizeof *f->at.first);
    f->at.triangle = mem_array(3 * m->triangle_count, sizeof *f->at.triangle);
    for (size_t t = 0; t < m->triangle_count; t++)
        for (int c = 0; c < 3; c++)
            f->at.first[f->weld[m->index[t][c]] + 1]++;
    for (size_t v = 0; v < m->vertex_count; v++)
        f->at.first[v + 1] += f->at.first[v];
    uint32_t *end = mem_array(m->vertex_count + 1, sizeof *end);
    memcpy(end, f->at.first, (m->vertex_count + 1) * sizeof *end);
    for (size_t t = 0; t < m->triangle_count; t++)
        for (int c = 0; c < 3; c++)
            f->at.triangle[end[f->weld[m->index[t][c]]]++] = (uint32_t)t;
    mem_free(end);
}

/* Those that share a corner with a triangle; one that shares two is there twice. */
static size_t neighbours_of(const struct filter *f, size_t t, uint32_t neighbour[NEIGHBOURS_MOST]) {
    size_t count = 0;
    for (int c = 0; c < 3; c++) {
        uint32_t v = f->weld[f->mesh->index[t][c]];
        for (uint32_t i = f->at.first[v]; i < f->at.first[v + 1] && count < NEIGHBOURS_MOST; i++) {
            if (f->at.triangle[i] != t)
                neighbour[count++] = f->at.triangle[i];
        }
    }
    return count;
}

/* --- filter ------------------------------------------------------------------------------------- */

static float roughness_of(const struct filter *f) {
    size_t triangles = f->mesh->triangle_count, samples = triangles < SAMPLES_MOST ? triangles : SAMPLES_MOST;
    float *rough = mem_array(samples, sizeof *rough);
    for (size_t i = 0; i < samples; i++) {
        uint32_t neighbour[NEIGHBOURS_MOST];
        float off[NEIGHBOURS_MOST];
        size_t t = i * triangles / samples, count = neighbours_of(f, t, neighbour);
        for (size_t k = 0; k < count; k++)
            off[k] = vec3_length(vec3_sub(f->normal[neighbour[k]], f->normal[t]));
        rough[i] = quantile(off, count, 0.25);
    }
    float median = quantile(rough, samples, 0.5);
    mem_free(rough);
    return median;
}

static void filter_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct filter *f = user;
    size_t begin = chunk * CHUNK, end = begin + CHUNK;
    for (size_t t = begin; t < end && t < f->mesh->triangle_count; t++) {
        uint32_t neighbour[NEIGHBOURS_MOST];
        size_t count = neighbours_of(f, t, neighbour);
        vec3 sum = vec3_scale(f->normal[t], f->area[t]);
        for (size_t k = 0; k < count; k++) {
            vec3 other = f->normal[neighbour[k]], off = vec3_sub(other, f->normal[t]);
            float unlike = vec3_dot(off, off) / (2.0f * f->spread * f->spread);
            sum = vec3_mad(sum, f->area[neighbour[k]] * expf(-unlike), other);
        }
        f->next[t] = vec3_normalize(sum);
    }
}

static void filter_normals(struct filter *f, float roughness, struct parallel *pool) {
    f->spread = fminf(fmaxf(ALIKE * roughness, LEAST_ALIKE), MOST_ALIKE);
    for (int pass = 0; pass < PASSES; pass++) {
        parallel_for(pool, (f->mesh->triangle_count + CHUNK - 1) / CHUNK, filter_chunk, f);
        vec3 *filtered = f->next;
        f->next = f->normal;
        f->normal = filtered;
    }
}

/* --- vertices ----------------------------------------------------------------------------------- */

/* Vertices of the result. */
struct vertices {
    size_t count, capacity;
    vec3 *position, *normal;
    bool any; /* normals differ from those of the triangles */
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

static int corner_at(const struct filter *f, size_t t, size_t vertex) {
    int c = 0;
    while (f->weld[f->mesh->index[t][c]] != vertex)
        c++;
    return c;
}

/* Makes vertices for the triangles at one welded vertex: each goes with the first one that is not across an edge
 * from it. The corners of the triangles are set in `index`. */
static void make_vertices(const struct filter *f, size_t vertex, struct vertices *v, uint32_t (*index)[3]) {
    size_t begin = v->count;
    const uint32_t *first = &f->at.triangle[f->at.first[vertex]], *end = &f->at.triangle[f->at.first[vertex + 1]];
    for (const uint32_t *t = first; t < end; t++) {
        size_t i = begin;
        while (i < v->count && vec3_dot(vec3_normalize(v->normal[i]), f->normal[*t]) < EDGE_COSINE)
            i++;
        vec3 part = vec3_scale(f->normal[*t], f->area[*t]);
        if (i == v->count)
            add_vertex(v, f->mesh->position[vertex], part);
        else
            v->normal[i] = vec3_add(v->normal[i], part);
        index[*t][corner_at(f, *t, vertex)] = (uint32_t)i;
    }
    for (size_t i = begin; i < v->count; i++)
        v->normal[i] = vec3_normalize(v->normal[i]);
    for (const uint32_t *t = first; t < end; t++) {
        vec3 own = vec3_normalize(mesh_cross(f->mesh, *t));
        v->any = v->any || vec3_dot(own, v->normal[index[*t][corner_at(f, *t, vertex)]]) < 1.0f - FLAT;
    }
}

/* Hands the vertices over, if there is any use of them. */
static bool take_over(struct mesh *mesh, struct vertices *v, uint32_t (*index)[3]) {
    if (!v->any) {
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
    uint32_t *weld = mesh_weld(mesh);
    struct filter f = {.mesh = mesh, .weld = weld};
    struct vertices vertices = {0};
    uint32_t(*index)[3] = mem_array(mesh->triangle_count, sizeof *index);
    collect_triangles(&f);
    f.area = mem_array(mesh->triangle_count, sizeof *f.area);
    f.normal = mem_array(mesh->triangle_count, sizeof *f.normal);
    f.next = mem_array(mesh->triangle_count, sizeof *f.next);
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        vec3 cross = mesh_cross(mesh, t);
        f.area[t] = vec3_length(cross);
        f.normal[t] = vec3_normalize(cross);
    }
    *roughness = roughness_of(&f);
    if (*roughness > SMOOTH)
        filter_normals(&f, *roughness, pool);
    for (size_t v = 0; v < mesh->vertex_count; v++)
        make_vertices(&f, v, &vertices, index);
    mem_free(f.next);
    mem_free(f.normal);
    mem_free(f.area);
    mem_free(f.at.triangle);
    mem_free(f.at.first);
    mem_free(weld);
    return take_over(mesh, &vertices, index);
}
