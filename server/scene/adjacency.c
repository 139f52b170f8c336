/* adjacency.c -- see adjacency.h. Half-edges are bucketed by their lower end, then sorted by
 * their upper one within a bucket of a few entries. */
#include "server/scene/adjacency.h"

#include <stdlib.h>

#include "common/mem.h"

#define SMOOTH_ROUNDS 8 /* rings of neighbours that are averaged */
#define CREASE 0.7f     /* 1 - cosine of the angle from which on smoothing stops: 73 degrees */

struct half_edge {
    uint32_t upper;  /* the end with the greater welded number */
    uint32_t number; /* 3 t + e */
};

static int by_upper_then_number(const void *left, const void *right) {
    const struct half_edge *a = left, *b = right;
    if (a->upper != b->upper)
        return a->upper < b->upper ? -1 : 1;
    return a->number < b->number ? -1 : a->number > b->number;
}

static void ends(const struct mesh *mesh, const uint32_t *weld, size_t half_edge, uint32_t *lower, uint32_t *upper) {
    const uint32_t *v = mesh->index[half_edge / 3];
    uint32_t a = weld[v[half_edge % 3]], b = weld[v[(half_edge + 1) % 3]];
    *lower = a < b ? a : b;
    *upper = a < b ? b : a;
}

/* Links the runs of one upper end in bucket[count], which it sorts. */
static void link_bucket(struct half_edge *bucket, size_t count, uint32_t *next) {
    qsort(bucket, count, sizeof *bucket, by_upper_then_number);
    for (size_t i = 0; i < count;) {
        size_t end = i + 1;
        while (end < count && bucket[end].upper == bucket[i].upper)
            end++;
        for (size_t k = i; k < end; k++)
            next[bucket[k].number] = bucket[k + 1 < end ? k + 1 : i].number;
        i = end;
    }
}

void adjacency_make(struct adjacency *adjacency, const struct mesh *mesh) {
    size_t half_edge_count = 3 * mesh->triangle_count;
    adjacency->weld = mesh_weld(mesh);
    adjacency->next = mem_array(half_edge_count, sizeof *adjacency->next);
    size_t *start = mem_calloc(mesh->vertex_count + 1, sizeof *start);
    struct half_edge *sorted = mem_array(half_edge_count, sizeof *sorted);
    uint32_t lower, upper;
    for (size_t h = 0; h < half_edge_count; h++) {
        ends(mesh, adjacency->weld, h, &lower, &upper);
        start[lower]++;
    }
    size_t sum = 0;
    for (size_t v = 0; v <= mesh->vertex_count; v++) {
        sum += start[v];
        start[v] = sum; /* the end of the bucket, moved to its start by the loop below */
    }
    for (size_t h = half_edge_count; h-- > 0;) {
        ends(mesh, adjacency->weld, h, &lower, &upper);
        sorted[--start[lower]] = (struct half_edge){upper, (uint32_t)h};
    }
    for (size_t v = 0; v < mesh->vertex_count; v++)
        link_bucket(sorted + start[v], start[v + 1] - start[v], adjacency->next);
    mem_free(sorted);
    mem_free(start);
}

void adjacency_release(struct adjacency *adjacency) {
    mem_free(adjacency->weld);
    mem_free(adjacency->next);
    *adjacency = (struct adjacency){0};
}

bool adjacency_is_closed(const struct adjacency *adjacency, const struct mesh *mesh) {
    for (uint32_t h = 0; h < 3 * mesh->triangle_count; h++) {
        if (adjacency->next[h] == h)
            return false;
    }
    return true;
}

vec3 *adjacency_smooth_normals(const struct adjacency *adjacency, const struct mesh *mesh) {
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
