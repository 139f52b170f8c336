/* mesh_round.c -- see mesh_round.h. */
#include "server/scene/mesh_round.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"

#define CHUNK 1024             /* vertices per work item */
#define EDGE_COSINE 0.5f       /* between the normals of a vertex and its triangles; below it there is an edge */
#define MIN_NORMAL_COSINE 0.5f /* between the normals of vertices in one fit */
#define MIN_NEIGHBOURS 12      /* vertices in the first fit; each further fit has half as many more */
#define MAX_NEIGHBOURS 96      /* vertices in one fit; bounds time and stack */
#define VISITED_SLOTS 256      /* of the hash set; more than twice MAX_NEIGHBOURS */
#define MAX_CHI2_SIGMA                                                                                                 \
    5.0                    /* residual of a fit, in standard deviations of chi squared, above which the surface is
                              * no paraboloid */
#define INTERVAL_SIGMA 0.7 /* half width of a fit's confidence interval, standard deviations */

struct smoothing {
    struct mesh *mesh;
    const vec3 *measured;
    const struct face_normals *faces;
    const struct mesh_planes *planes;
    const vec3 *normal; /* [vertex_count] unit, of welded vertices */
    vec3 *to;           /* [vertex_count] */
    float noise;
};

struct neighbour {
    float distance; /* m^2 */
    uint32_t vertex;
};

static int by_distance(const void *a, const void *b) {
    const struct neighbour *x = a, *y = b;
    if (x->distance != y->distance)
        return x->distance < y->distance ? -1 : 1;
    return x->vertex < y->vertex ? -1 : x->vertex > y->vertex;
}

static bool is_curved(const struct smoothing *s, uint32_t v) {
    const struct face_normals *f = s->faces;
    bool is = f->weld[v] == v && f->first[v + 1] > f->first[v];
    for (uint32_t k = f->first[v]; is && k < f->first[v + 1]; k++)
        is = s->planes->region[f->triangle[k]] == MESH_PLANES_NONE &&
             vec3_dot(f->normal[f->triangle[k]], s->normal[v]) > EDGE_COSINE;
    return is;
}

/* Adds a vertex to an open-addressing hash set; false when it was in it. */
static bool visit_add(uint32_t visited[VISITED_SLOTS], uint32_t vertex) {
    uint32_t slot = vertex * 2654435761u % VISITED_SLOTS; /* multiplicative hashing, Knuth 1973 */
    while (visited[slot] != UINT32_MAX && visited[slot] != vertex)
        slot = (slot + 1) % VISITED_SLOTS;
    bool is_added = visited[slot] != vertex;
    visited[slot] = vertex;
    return is_added;
}

/* Vertices connected to v through vertices with similar normals, nearest first, v included. */
static size_t find_neighbours(const struct smoothing *s, uint32_t v, struct neighbour neighbour[MAX_NEIGHBOURS]) {
    const struct face_normals *f = s->faces;
    uint32_t visited[VISITED_SLOTS];
    size_t count = 1;
    memset(visited, 0xff, sizeof visited);
    visit_add(visited, v);
    neighbour[0] = (struct neighbour){0.0f, v};
    for (size_t i = 0; i < count && count < MAX_NEIGHBOURS; i++) {
        uint32_t from = neighbour[i].vertex;
        for (uint32_t k = 3 * f->first[from]; k < 3 * f->first[from + 1] && count < MAX_NEIGHBOURS; k++) {
            uint32_t other = f->weld[s->mesh->index[f->triangle[k / 3]][k % 3]];
            if (vec3_dot(s->normal[other], s->normal[v]) < MIN_NORMAL_COSINE || !visit_add(visited, other))
                continue;
            vec3 off = vec3_sub(s->mesh->position[other], s->mesh->position[v]);
            neighbour[count++] = (struct neighbour){vec3_dot(off, off), other};
        }
    }
    qsort(neighbour, count, sizeof *neighbour, by_distance);
    return count;
}

/* Position of vertex v on the widest acceptable paraboloid: one with residuals explained by the noise, whose
 * confidence interval overlaps those of all narrower fits (Lepski 1991). The current position when there is none. */
static vec3 smoothed_position(const struct smoothing *s, uint32_t v) {
    struct neighbour neighbour[MAX_NEIGHBOURS];
    uint32_t vertex[MAX_NEIGHBOURS];
    double variance = (double)s->noise * (double)s->noise;
    vec3 best = s->mesh->position[v], at = s->measured[v];
    size_t found = find_neighbours(s, v, neighbour);
    for (size_t i = 0; i < found; i++)
        vertex[i] = neighbour[i].vertex;
    double low = -INFINITY, high = INFINITY;
    for (size_t count = MIN_NEIGHBOURS; count <= found; count += count / 2) {
        struct height_frame frame;
        struct height_fit fit;
        double freedom = (double)(count - HEIGHT_PARABOLOID);
        height_frame_init(&frame, s->normal[v], s->measured, vertex, count);
        if (!height_fit(&fit, HEIGHT_PARABOLOID, &frame, s->measured, vertex, count) ||
            fit.residual_squares > variance * (freedom + MAX_CHI2_SIGMA * sqrt(2.0 * freedom)))
            break;
        double move = height_fitted(&fit, &frame, at) - height_over(&frame, at);
        double error = INTERVAL_SIGMA * sqrt(variance * height_variance(&fit, &frame, at));
        low = fmax(low, move - error);
        high = fmin(high, move + error);
        if (low > high)
            break;
        best = vec3_mad(at, (float)move, frame.normal);
    }
    return best;
}

static void smooth_chunk(void *user, size_t chunk, int thread) {
    (void)thread;
    const struct smoothing *s = user;
    size_t begin = chunk * CHUNK, end = begin + CHUNK < s->mesh->vertex_count ? begin + CHUNK : s->mesh->vertex_count;
    for (size_t v = begin; v < end; v++)
        s->to[v] = is_curved(s, (uint32_t)v) ? smoothed_position(s, (uint32_t)v) : s->mesh->position[v];
}

void mesh_round_smooth(struct mesh *mesh, const vec3 *measured, float noise_m, const struct face_normals *faces,
                       const struct mesh_planes *planes, struct parallel *pool) {
    vec3 *normal = mem_array(mesh->vertex_count, sizeof *normal);
    vec3 *to = mem_array(mesh->vertex_count, sizeof *to);
    for (size_t v = 0; v < mesh->vertex_count; v++)
        normal[v] = face_normals_at(faces, v);
    struct smoothing smoothing = {mesh, measured, faces, planes, normal, to, noise_m};
    parallel_for(pool, (mesh->vertex_count + CHUNK - 1) / CHUNK, smooth_chunk, &smoothing);
    for (size_t v = 0; v < mesh->vertex_count; v++)
        mesh->position[v] = to[faces->weld[v]];
    mem_free(to);
    mem_free(normal);
}
