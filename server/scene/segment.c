/* segment.c -- see segment.h.
 *
 * Automatic segmentation: the graph segmentation of Felzenszwalb and Huttenlocher 2004 over triangles, as used for
 * scans by Dai et al. 2017 (ScanNet). The weight of an edge between two triangles is the difference of their normals;
 * two regions are joined over an edge no heavier than the heaviest edge inside either of them plus a bonus for small
 * regions. Noisy surfaces thus tolerate differences that would be borders on clean ones. Changes to the published
 * method: sizes are areas, since triangles of a modelled room differ by a factor of millions; normals are smoothed
 * first, but not across creases; a region that stays small joins its most similar neighbour or, in a scan, where
 * small floating components are fusion debris, the nearest region; and in a scan, which rounds what folds there are,
 * parts that stand off the plane of their region are split off (segment_relief.h). */
#include "server/scene/segment.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "common/rng.h"
#include "server/scene/adjacency.h"
#include "server/scene/segment_names.h"
#include "server/scene/segment_relief.h"

#define CONVEX_FACTOR                                                                                                  \
    0.3f            /* of the weight of a convex fold: objects are convex, and borders between objects are
                               * mostly concave */
#define FLAT 0.002f /* weight below which there is no fold: 3.6 degrees concave, 6.6 convex */
#define SIZE_BONUS                                                                                                     \
    0.5 /* added to the internal difference of a region of 1 / BONUS_PARTS of the mesh's
                                    * area */
#define BONUS_PARTS 100000.0
#define SMALL_PARTS 5000.0 /* a region of less than 1 / SMALL_PARTS of the mesh is small */
#define SCAN_EVENNESS                                                                                                  \
    16.0 /* mean square of triangle areas over their squared mean: 1 to 3 for fused depth maps,
                               * hundreds for modelled rooms */

#define NONE UINT32_MAX /* no triangle, no number */

static int ascending(const void *left, const void *right) {
    int64_t a = *(const int64_t *)left, b = *(const int64_t *)right;
    return a < b ? -1 : a > b;
}

void segments_from_object_id(struct segments *s, const struct mesh *mesh) {
    size_t n = mesh->triangle_count;
    *s = (struct segments){.is_given = true};
    s->id = mem_array(n, sizeof *s->id);
    s->of_triangle = mem_array(n, sizeof *s->of_triangle);
    memcpy(s->id, mesh->object_id, n * sizeof *s->id);
    qsort(s->id, n, sizeof *s->id, ascending);
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
    uint32_t half_edge; /* continues at the next one of its ring */
};

/* Disjoint sets of triangles (union by area, path halving). */
struct regions {
    uint32_t *parent; /* [triangle_count] */
    double *area;     /* [triangle_count] of a root: m^2 */
    float *inside;    /* [triangle_count] of a root: greatest weight joined inside */
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

static vec3 centre_of(const struct mesh *mesh, uint32_t t) { return mesh_point(mesh, t, 1.0f / 3.0f, 1.0f / 3.0f); }

static int lightest_first(const void *left, const void *right) {
    const struct link *a = left, *b = right;
    if (a->weight != b->weight)
        return a->weight < b->weight ? -1 : 1;
    return a->half_edge < b->half_edge ? -1 : a->half_edge > b->half_edge;
}

/* All pairs of triangles that share an edge, in order of increasing weight. */
static struct link *make_links(const struct mesh *mesh, const struct adjacency *adjacency, size_t *count) {
    vec3 *normal = adjacency_smooth_normals(adjacency, mesh);
    struct link *link = mem_array(3 * mesh->triangle_count, sizeof *link);
    *count = 0;
    for (uint32_t h = 0; h < 3 * mesh->triangle_count; h++) {
        uint32_t next = adjacency->next[h];
        if (next <= h) /* alone on its edge, or the end of the ring: the links so far connect it */
            continue;
        uint32_t a = h / 3, b = next / 3;
        float bend = fmaxf(0.0f, 1.0f - vec3_dot(normal[a], normal[b]));
        vec3 between = vec3_sub(centre_of(mesh, b), centre_of(mesh, a));
        bool convex = vec3_dot(vec3_sub(normal[b], normal[a]), between) > 0.0f;
        float weight = convex ? CONVEX_FACTOR * bend : bend;
        link[(*count)++] = (struct link){fmaxf(0.0f, weight - FLAT), h};
    }
    mem_free(normal);
    qsort(link, *count, sizeof *link, lightest_first);
    return link;
}

static bool is_scan(const struct mesh *mesh, double total) {
    double squares = 0.0;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        double area = (double)mesh_triangle_area(mesh, t);
        squares += area * area;
    }
    return squares * (double)mesh->triangle_count < SCAN_EVENNESS * total * total;
}

/* Spatial hash of the triangles of large regions. */
struct cubes {
    const struct mesh *mesh;
    float side_m;
    size_t mask;
    uint32_t *head; /* [mask + 1] first triangle or NONE */
    uint32_t *next; /* [triangle_count] */
};

static void cube_of(const struct cubes *cubes, vec3 p, int64_t cube[3]) {
    cube[0] = (int64_t)floorf(p.x / cubes->side_m);
    cube[1] = (int64_t)floorf(p.y / cubes->side_m);
    cube[2] = (int64_t)floorf(p.z / cubes->side_m);
}

static size_t slot_of(const struct cubes *cubes, const int64_t cube[3]) {
    return rng_key((uint64_t)cube[0], (uint64_t)cube[1], (uint64_t)cube[2]) & cubes->mask;
}

/* The hashed triangle with its centre nearest to p, if nearer than *nearest_m (which is lowered) and within one cell;
 * else `otherwise`. */
static uint32_t nearest_triangle(const struct cubes *cubes, vec3 p, float *nearest_m, uint32_t otherwise) {
    int64_t middle[3];
    cube_of(cubes, p, middle);
    for (int i = 0; i < 27; i++) {
        int64_t cube[3] = {middle[0] + i % 3 - 1, middle[1] + i / 3 % 3 - 1, middle[2] + i / 9 - 1};
        for (uint32_t t = cubes->head[slot_of(cubes, cube)]; t != NONE; t = cubes->next[t]) {
            float distance_m = vec3_length(vec3_sub(centre_of(cubes->mesh, t), p));
            if (distance_m < *nearest_m || (distance_m == *nearest_m && t < otherwise)) {
                *nearest_m = distance_m;
                otherwise = t;
            }
        }
    }
    return otherwise;
}

/* Joins each region smaller than small_area to the nearest large region; those without one within the side length of
 * a small region are all joined together. */
static void merge_debris(struct regions *r, const struct mesh *mesh, double small_area) {
    size_t n = mesh->triangle_count;
    struct cubes cubes = {.mesh = mesh, .side_m = (float)sqrt(small_area), .mask = 1};
    while (cubes.mask < n)
        cubes.mask = 2 * cubes.mask + 1;
    cubes.head = mem_array(cubes.mask + 1, sizeof *cubes.head);
    cubes.next = mem_array(n, sizeof *cubes.next);
    memset(cubes.head, 0xff, (cubes.mask + 1) * sizeof *cubes.head);
    uint32_t *target = mem_array(n, sizeof *target); /* of a small root: a triangle, or NONE */
    float *distance_m = mem_array(n, sizeof *distance_m);
    for (uint32_t t = 0; t < n; t++) {
        target[t] = NONE;
        distance_m[t] = cubes.side_m;
        if (r->area[root_of(r, t)] < small_area)
            continue;
        int64_t cube[3];
        cube_of(&cubes, centre_of(mesh, t), cube);
        uint32_t *head = &cubes.head[slot_of(&cubes, cube)];
        cubes.next[t] = *head;
        *head = t;
    }
    for (uint32_t t = 0; t < n; t++) {
        uint32_t root = root_of(r, t);
        if (r->area[root] < small_area)
            target[root] = nearest_triangle(&cubes, centre_of(mesh, t), &distance_m[root], target[root]);
    }
    uint32_t strays = NONE;
    for (uint32_t t = 0; t < n; t++) {
        if (root_of(r, t) != t || r->area[t] >= small_area)
            continue;
        if (target[t] != NONE)
            join(r, root_of(r, target[t]), t, 0.0f);
        else if (strays == NONE)
            strays = t;
        else
            join(r, root_of(r, strays), t, 0.0f);
    }
    mem_free(distance_m);
    mem_free(target);
    mem_free(cubes.next);
    mem_free(cubes.head);
}

/* Numbers the regions in order of their first triangle. */
static void number_regions(struct segments *s, struct regions *r, size_t triangle_count) {
    uint32_t *number = mem_array(triangle_count, sizeof *number);
    for (size_t t = 0; t < triangle_count; t++)
        number[t] = NONE;
    *s = (struct segments){0};
    s->of_triangle = mem_array(triangle_count, sizeof *s->of_triangle);
    for (uint32_t t = 0; t < triangle_count; t++) {
        uint32_t root = root_of(r, t);
        if (number[root] == NONE)
            number[root] = (uint32_t)s->count++;
        s->of_triangle[t] = number[root];
    }
    mem_free(number);
}

void segments_automatic(struct segments *s, const struct mesh *mesh) {
    size_t n = mesh->triangle_count, link_count;
    struct adjacency adjacency;
    adjacency_make(&adjacency, mesh);
    struct link *link = make_links(mesh, &adjacency, &link_count);
    struct regions r = {mem_array(n, sizeof *r.parent), mem_array(n, sizeof *r.area), mem_calloc(n, sizeof *r.inside)};
    double total = mesh_area(mesh);
    for (uint32_t t = 0; t < n; t++) {
        r.parent[t] = t;
        r.area[t] = (double)mesh_triangle_area(mesh, t);
    }
    double bonus = SIZE_BONUS * total / BONUS_PARTS;
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
    bool scan = is_scan(mesh, total);
    if (scan)
        merge_debris(&r, mesh, total / SMALL_PARTS);
    number_regions(s, &r, n);
    if (scan)
        s->count = segment_relief_split(s->of_triangle, s->count, mesh, &adjacency, total / SMALL_PARTS);
    s->id = mem_array(s->count, sizeof *s->id);
    for (size_t i = 0; i < s->count; i++)
        s->id[i] = (int64_t)i;
    s->name = segment_names_make(s->of_triangle, s->count, mesh);
    s->name_count = s->name ? s->count : 0;
    mem_free(r.parent);
    mem_free(r.area);
    mem_free(r.inside);
    mem_free(link);
    adjacency_release(&adjacency);
}

const char *segments_name(const struct segments *s, const struct mesh *mesh, size_t segment) {
    int64_t id = s->id[segment];
    if (s->is_given)
        return mesh_object_name(mesh, id);
    return id >= 0 && (uint64_t)id < s->name_count ? s->name[id] : NULL;
}

uint32_t segments_known_part(const struct segments *s, uint32_t segment, const bool *is_known) {
    for (uint32_t i = 0; i < s->count && !is_known[segment]; i++) {
        if (is_known[i] && s->id[i] == s->id[segment])
            return i;
    }
    return segment;
}

void segments_release(struct segments *s) {
    for (size_t i = 0; i < s->name_count; i++)
        mem_free(s->name[i]);
    mem_free(s->name);
    mem_free(s->of_triangle);
    mem_free(s->id);
    *s = (struct segments){0};
}
