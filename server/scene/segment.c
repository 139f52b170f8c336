/* segment.c -- see segment.h.
 *
 * The automatic division is the graph segmentation of Felzenszwalb and Huttenlocher 2004 over
 * triangles, as Dai et al. 2017 (ScanNet) use it on scans: an edge between two triangles weighs
 * what their normals differ by, and two regions are joined over an edge that weighs no more than
 * what either has inside, plus a bonus for small regions. So a noisy surface tolerates in itself
 * what would be a border on a clean one. Three things are ours: sizes are areas, as triangles
 * of a modelled room differ by a factor of millions; normals are smoothed first, by a filter
 * that stops at creases; and a region that stays small joins its most similar neighbour. */
#include "server/scene/segment.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "server/scene/adjacency.h"

#define SMOOTH_ROUNDS 4
#define CREASE 0.5f           /* 1 - cosine from which on smoothing stops: 60 degrees */
#define CONVEX_FACTOR 0.3f    /* of an outward fold's weight: objects bulge, borders between two
                               * objects are mostly hollows */
#define BONUS 0.05            /* weight by which a region of 1 / BONUS_PARTS of the mesh may differ */
#define BONUS_PARTS 100000.0
#define SMALL_PARTS 20000.0   /* a region of less than 1 / SMALL_PARTS of the mesh is small */

static int ascending(const void *left, const void *right) {
    int64_t a = *(const int64_t *)left, b = *(const int64_t *)right;
    return a < b ? -1 : a > b;
}

void segments_from_object_id(struct segments *s, const struct mesh *mesh) {
    size_t n = mesh->triangle_count;
    s->id = mem_array(n, sizeof *s->id);
    s->of_triangle = mem_array(n, sizeof *s->of_triangle);
    memcpy(s->id, mesh->object_id, n * sizeof *s->id);
    qsort(s->id, n, sizeof *s->id, ascending);
    s->count = 0;
    for (size_t i = 0; i < n; i++)
        if (i == 0 || s->id[i] != s->id[i - 1])
            s->id[s->count++] = s->id[i];
    s->id = mem_realloc_array(s->id, s->count, sizeof *s->id);
    for (size_t t = 0; t < n; t++) {
        const int64_t *found = bsearch(&mesh->object_id[t], s->id, s->count, sizeof *s->id, ascending);
        s->of_triangle[t] = (uint32_t)(found - s->id);
    }
}

struct link {
    float weight;
    uint32_t half_edge; /* and the next one of its ring */
};

/* Disjoint sets of triangles (union by area, paths halved). */
struct regions {
    uint32_t *parent; /* [triangle_count] */
    double *area;     /* [triangle_count] of a root: m^2 */
    float *inside;    /* [triangle_count] of a root: the greatest weight joined over */
};

static uint32_t root_of(struct regions *r, uint32_t t) {
    while (r->parent[t] != t) {
        r->parent[t] = r->parent[r->parent[t]];
        t = r->parent[t];
    }
    return t;
}

static void join(struct regions *r, uint32_t a, uint32_t b, float weight) {
    if (r->area[a] < r->area[b] || (r->area[a] == r->area[b] && b < a)) {
        uint32_t swap = a;
        a = b;
        b = swap;
    }
    r->parent[b] = a;
    r->area[a] += r->area[b];
    r->inside[a] = fmaxf(weight, fmaxf(r->inside[a], r->inside[b]));
}

/* Unit normals, each averaged with its neighbours' as far as there is no crease between. */
static vec3 *smooth_normals(const struct mesh *mesh, const struct adjacency *adjacency) {
    size_t n = mesh->triangle_count;
    vec3 *normal = mem_array(n, sizeof *normal), *next = mem_array(n, sizeof *next);
    float *area = mem_array(n, sizeof *area);
    for (size_t t = 0; t < n; t++) {
        vec3 cross = mesh_cross(mesh, t);
        area[t] = vec3_length(cross);
        normal[t] = vec3_normalize(cross);
    }
    for (int round = 0; round < SMOOTH_ROUNDS; round++) {
        for (size_t t = 0; t < n; t++) {
            vec3 sum = vec3_scale(normal[t], area[t]);
            for (uint32_t half = (uint32_t)(3 * t); half < 3 * t + 3; half++)
                for (uint32_t h = adjacency->next[half]; h != half; h = adjacency->next[h]) {
                    float bend = 1.0f - vec3_dot(normal[t], normal[h / 3]);
                    float like = fmaxf(0.0f, 1.0f - bend / CREASE);
                    sum = vec3_mad(sum, like * like * area[h / 3], normal[h / 3]);
                }
            next[t] = vec3_normalize(sum);
        }
        vec3 *swap = normal;
        normal = next;
        next = swap;
    }
    mem_free(next);
    mem_free(area);
    return normal;
}

static vec3 centre_of(const struct mesh *mesh, uint32_t t) {
    return mesh_point(mesh, t, 1.0f / 3.0f, 1.0f / 3.0f);
}

static int lightest_first(const void *left, const void *right) {
    const struct link *a = left, *b = right;
    if (a->weight != b->weight)
        return a->weight < b->weight ? -1 : 1;
    return a->half_edge < b->half_edge ? -1 : a->half_edge > b->half_edge;
}

/* All pairs of triangles that meet at an edge, the most alike first. */
static struct link *make_links(const struct mesh *mesh, const struct adjacency *adjacency,
                               size_t *count) {
    vec3 *normal = smooth_normals(mesh, adjacency);
    struct link *link = mem_array(3 * mesh->triangle_count, sizeof *link);
    *count = 0;
    for (uint32_t h = 0; h < 3 * mesh->triangle_count; h++) {
        uint32_t next = adjacency->next[h];
        if (next <= h) /* alone on its edge, or the end of the ring: the links before suffice */
            continue;
        uint32_t a = h / 3, b = next / 3;
        float bend = fmaxf(0.0f, 1.0f - vec3_dot(normal[a], normal[b]));
        vec3 between = vec3_sub(centre_of(mesh, b), centre_of(mesh, a));
        bool convex = vec3_dot(vec3_sub(normal[b], normal[a]), between) > 0.0f;
        link[(*count)++] = (struct link){convex ? CONVEX_FACTOR * bend : bend, h};
    }
    mem_free(normal);
    qsort(link, *count, sizeof *link, lightest_first);
    return link;
}

/* Numbers the regions in order of their first triangle. */
static void number_regions(struct segments *s, struct regions *r, size_t triangle_count) {
    uint32_t *number = mem_array(triangle_count, sizeof *number);
    memset(number, 0xff, triangle_count * sizeof *number);
    s->count = 0;
    s->of_triangle = mem_array(triangle_count, sizeof *s->of_triangle);
    for (uint32_t t = 0; t < triangle_count; t++) {
        uint32_t root = root_of(r, t);
        if (number[root] == UINT32_MAX)
            number[root] = (uint32_t)s->count++;
        s->of_triangle[t] = number[root];
    }
    mem_free(number);
    s->id = mem_array(s->count, sizeof *s->id);
    for (size_t i = 0; i < s->count; i++)
        s->id[i] = (int64_t)i;
}

void segments_automatic(struct segments *s, const struct mesh *mesh) {
    size_t n = mesh->triangle_count, link_count;
    struct adjacency adjacency;
    adjacency_make(&adjacency, mesh);
    struct link *link = make_links(mesh, &adjacency, &link_count);
    struct regions r = {mem_array(n, sizeof *r.parent), mem_array(n, sizeof *r.area),
                        mem_calloc(n, sizeof *r.inside)};
    double total = mesh_area(mesh);
    for (uint32_t t = 0; t < n; t++) {
        r.parent[t] = t;
        r.area[t] = 0.5 * (double)vec3_length(mesh_cross(mesh, t));
    }
    double bonus = BONUS * total / BONUS_PARTS;
    for (size_t i = 0; i < link_count; i++) {
        uint32_t a = root_of(&r, link[i].half_edge / 3);
        uint32_t b = root_of(&r, adjacency.next[link[i].half_edge] / 3);
        double weight = (double)link[i].weight;
        if (a != b && weight <= (double)r.inside[a] + bonus / r.area[a] &&
            weight <= (double)r.inside[b] + bonus / r.area[b])
            join(&r, a, b, link[i].weight);
    }
    for (size_t i = 0; i < link_count; i++) {
        uint32_t a = root_of(&r, link[i].half_edge / 3);
        uint32_t b = root_of(&r, adjacency.next[link[i].half_edge] / 3);
        if (a != b && fmin(r.area[a], r.area[b]) < total / SMALL_PARTS)
            join(&r, a, b, link[i].weight);
    }
    number_regions(s, &r, n);
    mem_free(r.parent);
    mem_free(r.area);
    mem_free(r.inside);
    mem_free(link);
    adjacency_release(&adjacency);
}

void segments_release(struct segments *s) {
    mem_free(s->of_triangle);
    mem_free(s->id);
    *s = (struct segments){0};
}
