/* regions.c -- see regions.h. */
#include "server/scene/regions.h"

#include <math.h>
#include <stdlib.h>

#include "common/mem.h"

#define SIZE_BONUS                                                                                                     \
    0.5 /* added to the internal difference of a region of 1 / BONUS_PARTS of the mesh's                               \
         * area */
#define BONUS_PARTS 100000.0

void regions_init(struct regions *r, const struct mesh *mesh) {
    size_t n = mesh->triangle_count;
    *r = (struct regions){n, mem_array(n, sizeof *r->parent), mem_array(n, sizeof *r->area),
                          mem_calloc(n, sizeof *r->inside)};
    for (uint32_t t = 0; t < n; t++) {
        r->parent[t] = t;
        r->area[t] = (double)mesh_triangle_area(mesh, t);
    }
}

void regions_release(struct regions *r) {
    mem_free(r->inside);
    mem_free(r->area);
    mem_free(r->parent);
}

uint32_t regions_root(struct regions *r, uint32_t triangle) {
    while (r->parent[triangle] != triangle) {
        r->parent[triangle] = r->parent[r->parent[triangle]];
        triangle = r->parent[triangle];
    }
    return triangle;
}

void regions_join(struct regions *r, uint32_t a, uint32_t b, float weight) {
    if (r->area[a] < r->area[b] || (r->area[a] == r->area[b] && b < a)) {
        uint32_t swap = a;
        a = b;
        b = swap;
    }
    r->parent[b] = a;
    r->area[a] += r->area[b];
    r->inside[a] = fmaxf(weight, fmaxf(r->inside[a], r->inside[b]));
}

static int lightest_first(const void *left, const void *right) {
    const struct region_link *a = left, *b = right;
    if (a->weight != b->weight)
        return a->weight < b->weight ? -1 : 1;
    return a->half_edge < b->half_edge ? -1 : a->half_edge > b->half_edge;
}

void regions_sort_links(struct region_link *link, size_t count) { qsort(link, count, sizeof *link, lightest_first); }

void regions_join_by_weight(struct regions *r, const struct adjacency *adjacency, const struct region_link *link,
                            size_t count, double total) {
    double bonus = SIZE_BONUS * total / BONUS_PARTS;
    for (size_t i = 0; i < count; i++) {
        uint32_t a = regions_root(r, link[i].half_edge / 3), b = regions_root(r, region_link_end(adjacency, &link[i]));
        double weight = (double)link[i].weight;
        if (a != b && weight <= (double)r->inside[a] + bonus / r->area[a] &&
            weight <= (double)r->inside[b] + bonus / r->area[b])
            regions_join(r, a, b, link[i].weight);
    }
}
