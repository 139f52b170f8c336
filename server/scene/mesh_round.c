/* mesh_round.c -- see mesh_round.h. */
#include "server/scene/mesh_round.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"

#define CHUNK 1024     /* vertices a work item */
#define EDGE 0.5f      /* cosine between normals of a vertex and a triangle at it, where no edge runs */
#define LIKE 0.5f      /* cosine between normals of vertices that may lie on one bend */
#define NEAR_LEAST 12  /* vertices in a fit; half as many again each time */
#define NEAR_MOST 96
#define KNOWN_MOST 256 /* slots, more than twice as many */
#define UNLIKELY 5.0   /* standard deviations of what is left, over what noise would leave: no fit any more */
#define AGREE 0.7      /* standard deviations of a fit: by as much either way it may be off */

struct smoothing {
    struct mesh *mesh;
    const vec3 *measured;
    const struct face_normals *faces;
    const struct mesh_planes *planes;
    const vec3 *normal; /* [vertex_count] unit, of welded vertices */
    vec3 *to;           /* [vertex_count] */
    float noise;
};

struct near {
    float distance; /* m^2 */
    uint32_t vertex;
};

static int by_distance(const void *a, const void *b) {
    const struct near *x = a, *y = b;
    if (x->distance != y->distance)
        return x->distance < y->distance ? -1 : 1;
    return x->vertex < y->vertex ? -1 : x->vertex > y->vertex;
}

static bool is_round(const struct smoothing *s, uint32_t v) {
    const struct face_normals *f = s->faces;
    bool is = f->weld[v] == v && f->first[v + 1] > f->first[v];
    for (uint32_t k = f->first[v]; is && k < f->first[v + 1]; k++)
        is = s->planes->part[f->triangle[k]] == MESH_PLANES_NONE &&
             vec3_dot(f->normal[f->triangle[k]], s->normal[v]) > EDGE;
    return is;
}

/* Adds a vertex to a set of fewer than KNOWN_MOST; false where it is there already. */
static bool learn(uint32_t known[KNOWN_MOST], uint32_t vertex) {
    uint32_t slot = vertex * 2654435761u % KNOWN_MOST; /* Knuth 1973 */
    while (known[slot] != UINT32_MAX && known[slot] != vertex)
        slot = (slot + 1) % KNOWN_MOST;
    bool is_new = known[slot] != vertex;
    known[slot] = vertex;
    return is_new;
}

/* The vertices that are joined to v over such as face its way, nearest first. */
static size_t find_near(const struct smoothing *s, uint32_t v, struct near near[NEAR_MOST]) {
    const struct face_normals *f = s->faces;
    uint32_t known[KNOWN_MOST];
    size_t count = 1;
    memset(known, 0xff, sizeof known);
    learn(known, v);
    near[0] = (struct near){0.0f, v};
    for (size_t i = 0; i < count && count < NEAR_MOST; i++) {
        uint32_t from = near[i].vertex;
        for (uint32_t k = 3 * f->first[from]; k < 3 * f->first[from + 1] && count < NEAR_MOST; k++) {
            uint32_t other = f->weld[s->mesh->index[f->triangle[k / 3]][k % 3]];
            if (vec3_dot(s->normal[other], s->normal[v]) < LIKE || !learn(known, other))
                continue;
            vec3 off = vec3_sub(s->mesh->position[other], s->mesh->position[v]);
            near[count++] = (struct near){vec3_dot(off, off), other};
        }
    }
    qsort(near, count, sizeof *near, by_distance);
    return count;
}

/* Where the widest paraboloid that fits, and says what all narrower ones do within their errors, has vertex v; where it is
 * now, if none does. */
static vec3 smooth(const struct smoothing *s, uint32_t v) {
    struct near near[NEAR_MOST];
    uint32_t vertex[NEAR_MOST];
    double variance = (double)s->noise * (double)s->noise;
    vec3 best = s->mesh->position[v], at = s->measured[v];
    size_t found = find_near(s, v, near);
    for (size_t i = 0; i < found; i++)
        vertex[i] = near[i].vertex;
    double low = -INFINITY, high = INFINITY;
    for (size_t count = NEAR_LEAST; count <= found; count += count / 2) {
        struct height_frame frame;
        struct height_fit fit;
        double freedom = (double)(count - HEIGHT_PARABOLOID);
        height_frame_init(&frame, s->normal[v], s->measured, vertex, count);
        if (!height_fit(&fit, HEIGHT_PARABOLOID, &frame, s->measured, vertex, count) ||
            fit.squares > variance * (freedom + UNLIKELY * sqrt(2.0 * freedom)))
            break;
        double move = height_fitted(&fit, &frame, at) - height_over(&frame, at);
        double error = AGREE * sqrt(variance * height_variance(&fit, &frame, at));
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
        s->to[v] = is_round(s, (uint32_t)v) ? smooth(s, (uint32_t)v) : s->mesh->position[v];
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
