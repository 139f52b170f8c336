/* face_normals.c -- see face_normals.h. */
#include "server/scene/face_normals.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "common/quantile.h"

#define CHUNK 1024      /* triangles per work item */
#define FILTER_PASSES 5 /* of the bilateral filter over all triangles */
/* Standard deviation of the filter's range kernel (normals differing by it weigh 0.6), in units of roughness and
 * clamped. */
#define SPREAD_FACTOR 2.0f
#define MIN_SPREAD 0.15f
#define MAX_SPREAD 0.4f
#define MAX_NEIGHBOURS 64 /* considered per triangle; only poles of spheres have more */
#define MAX_SAMPLES 65536 /* triangles in the roughness estimate */

struct filter {
    const struct mesh *mesh;
    const struct face_normals *faces;
    const vec3 *from; /* [triangle_count] */
    vec3 *to;         /* [triangle_count] */
    float spread;
};

static void collect_triangles(struct face_normals *f, const struct mesh *m) {
    f->first = mem_calloc(m->vertex_count + 1, sizeof *f->first);
    f->triangle = mem_array(3 * m->triangle_count, sizeof *f->triangle);
    for (size_t t = 0; t < m->triangle_count; t++)
        for (int c = 0; c < 3; c++)
            f->first[f->weld[m->index[t][c]] + 1]++;
    for (size_t v = 0; v < m->vertex_count; v++)
        f->first[v + 1] += f->first[v];
    uint32_t *end = mem_array(m->vertex_count + 1, sizeof *end);
    memcpy(end, f->first, (m->vertex_count + 1) * sizeof *end);
    for (size_t t = 0; t < m->triangle_count; t++)
        for (int c = 0; c < 3; c++)
            f->triangle[end[f->weld[m->index[t][c]]]++] = (uint32_t)t;
    mem_free(end);
}

/* Triangles that share a vertex with triangle t; those that share an edge are listed twice. */
static size_t neighbours_of(const struct face_normals *f, const struct mesh *mesh, size_t t,
                            uint32_t neighbour[MAX_NEIGHBOURS]) {
    size_t count = 0;
    for (int c = 0; c < 3; c++) {
        uint32_t v = f->weld[mesh->index[t][c]];
        for (uint32_t i = f->first[v]; i < f->first[v + 1] && count < MAX_NEIGHBOURS; i++) {
            if (f->triangle[i] != t)
                neighbour[count++] = f->triangle[i];
        }
    }
    return count;
}

static void measure_roughness(struct face_normals *f, const struct mesh *mesh) {
    size_t triangles = mesh->triangle_count, samples = triangles < MAX_SAMPLES ? triangles : MAX_SAMPLES;
    float *roughness = mem_array(samples, sizeof *roughness), *least = mem_array(samples, sizeof *least);
    for (size_t i = 0; i < samples; i++) {
        uint32_t neighbour[MAX_NEIGHBOURS];
        float difference[MAX_NEIGHBOURS];
        size_t t = i * triangles / samples, count = neighbours_of(f, mesh, t, neighbour);
        for (size_t k = 0; k < count; k++)
            difference[k] = vec3_length(vec3_sub(f->normal[neighbour[k]], f->normal[t]));
        roughness[i] = quantile(difference, count, 0.25);
        least[i] = quantile(difference, count, 0.0);
    }
    f->roughness = quantile(roughness, samples, 0.5);
    f->least_difference = quantile(least, samples, 0.5);
    mem_free(least);
    mem_free(roughness);
}

static void filter_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct filter *filter = user;
    size_t begin = chunk * CHUNK, end = begin + CHUNK;
    for (size_t t = begin; t < end && t < filter->mesh->triangle_count; t++) {
        uint32_t neighbour[MAX_NEIGHBOURS];
        size_t count = neighbours_of(filter->faces, filter->mesh, t, neighbour);
        const float *area = filter->faces->area;
        vec3 sum = vec3_scale(filter->from[t], area[t]);
        for (size_t k = 0; k < count; k++) {
            vec3 other = filter->from[neighbour[k]], difference = vec3_sub(other, filter->from[t]);
            float exponent = vec3_dot(difference, difference) / (2.0f * filter->spread * filter->spread);
            sum = vec3_mad(sum, area[neighbour[k]] * expf(-exponent), other);
        }
        filter->to[t] = vec3_normalize(sum);
    }
}

static void filter_normals(struct face_normals *f, const struct mesh *mesh, struct parallel *pool) {
    vec3 *next = mem_array(mesh->triangle_count, sizeof *next);
    float spread = fminf(fmaxf(SPREAD_FACTOR * f->roughness, MIN_SPREAD), MAX_SPREAD);
    for (int pass = 0; pass < FILTER_PASSES; pass++) {
        struct filter filter = {mesh, f, f->normal, next, spread};
        parallel_for(pool, (mesh->triangle_count + CHUNK - 1) / CHUNK, filter_chunk, &filter);
        next = f->normal;
        f->normal = filter.to;
    }
    mem_free(next);
}

void face_normals_init(struct face_normals *f, const struct mesh *mesh, struct parallel *pool) {
    *f = (struct face_normals){.weld = mesh_weld(mesh)};
    collect_triangles(f, mesh);
    f->area = mem_array(mesh->triangle_count, sizeof *f->area);
    f->normal = mem_array(mesh->triangle_count, sizeof *f->normal);
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        vec3 cross = mesh_cross(mesh, t);
        f->area[t] = vec3_length(cross);
        f->normal[t] = vec3_normalize(cross);
    }
    measure_roughness(f, mesh);
    if (face_normals_are_rough(f))
        filter_normals(f, mesh, pool);
}

vec3 face_normals_at(const struct face_normals *f, size_t v) {
    vec3 sum = {0.0f, 0.0f, 0.0f};
    for (uint32_t i = f->first[v]; i < f->first[v + 1]; i++)
        sum = vec3_mad(sum, f->area[f->triangle[i]], f->normal[f->triangle[i]]);
    return vec3_normalize(sum);
}

void face_normals_release(struct face_normals *f) {
    mem_free(f->normal);
    mem_free(f->area);
    mem_free(f->weld);
    mem_free(f->first);
    mem_free(f->triangle);
}
