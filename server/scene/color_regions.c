/* color_regions.c -- see color_regions.h. */
#include "server/scene/color_regions.h"

#include <string.h>

#include "common/mem.h"

/* Part of the least area that a core has away from its borders. */
#define MIN_WITHIN 0.1

static void make_links(struct color_regions *s) {
    s->link = mem_array(3 * s->mesh->triangle_count + 1, sizeof *s->link);
    for (uint32_t h = 0; h < 3 * s->mesh->triangle_count; h++) {
        uint32_t next = s->adjacency->next[h], a = h / 3, b = next / 3;
        if (next <= h || s->of_triangle[a] != s->of_triangle[b])
            continue;
        float weight =
            color_is_known(s, a) && color_is_known(s, b) ? color_distance(s->value[a], s->value[b]) : INFINITY;
        s->link[s->link_count++] = (struct region_link){weight, h};
    }
    regions_sort_links(s->link, s->link_count);
}

/* Roots of the two triangles of link i. */
static void roots_of(struct color_regions *s, size_t i, uint32_t root[2]) {
    root[0] = regions_root(&s->regions, s->link[i].half_edge / 3);
    root[1] = regions_root(&s->regions, region_link_end(s->adjacency, &s->link[i]));
}

uint32_t *color_roots(struct color_regions *s) {
    uint32_t *root = mem_array(s->mesh->triangle_count, sizeof *root);
    for (uint32_t t = 0; t < s->mesh->triangle_count; t++)
        root[t] = regions_root(&s->regions, t);
    return root;
}

void color_rings(const struct color_regions *s, const uint32_t *region, uint8_t *ring, uint32_t *beyond) {
    size_t n = s->mesh->triangle_count, first = 0, last = 0;
    uint32_t *queue = mem_array(n, sizeof *queue);
    memset(ring, 0, n);
    for (uint32_t t = 0; t < n; t++) {
        for (uint32_t half = 3 * t; half < 3 * t + 3 && ring[t] == 0; half++) {
            uint32_t other = s->adjacency->next[half] / 3;
            if (s->of_triangle[other] != s->of_triangle[t] || region[other] == region[t])
                continue;
            ring[t] = 1;
            beyond[t] = region[other];
            queue[last++] = t;
        }
    }
    for (; first < last; first++) {
        uint32_t t = queue[first];
        for (uint32_t half = 3 * t; half < 3 * t + 3 && ring[t] < COLOR_FAR_RINGS; half++) {
            uint32_t other = s->adjacency->next[half] / 3;
            if (ring[other] != 0 || region[other] != region[t])
                continue;
            ring[other] = (uint8_t)(ring[t] + 1);
            beyond[other] = beyond[t];
            queue[last++] = other;
        }
    }
    mem_free(queue);
}

/* Takes apart the regions that are smaller than least_area or have next to nothing away from their borders. Sets
 * is_core[triangle_count], of roots. */
static void keep_cores(struct color_regions *s, double least_area, bool *is_core) {
    size_t n = s->mesh->triangle_count;
    uint8_t *ring = mem_array(n, sizeof *ring);
    uint32_t *beyond = mem_array(n, sizeof *beyond), *root = color_roots(s);
    double *within = mem_calloc(n, sizeof *within);
    struct regions kept;
    color_rings(s, root, ring, beyond);
    for (uint32_t t = 0; t < n; t++)
        if (ring[t] == 0 || ring[t] >= COLOR_NEAR_RINGS)
            within[root[t]] += (double)mesh_triangle_area(s->mesh, t);
    regions_init(&kept, s->mesh);
    memset(is_core, 0, n);
    for (uint32_t t = 0; t < n; t++) {
        bool stays = s->regions.area[root[t]] >= least_area && within[root[t]] >= MIN_WITHIN * least_area;
        if (stays && t != root[t])
            regions_join(&kept, regions_root(&kept, root[t]), t, 0.0f);
        else if (stays)
            is_core[t] = true;
    }
    for (uint32_t t = 0; t < n; t++) /* of the roots that joining chose */
        if (is_core[t])
            is_core[regions_root(&kept, t)] = true;
    regions_release(&s->regions);
    s->regions = kept;
    mem_free(within);
    mem_free(root);
    mem_free(beyond);
    mem_free(ring);
}

/* Gives all triangles to cores, round by round over the links that are left, the lightest first; where a connected part
 * of a segment has none it is one region. */
static void grow_cores(struct color_regions *s, bool *is_core) {
    size_t *left = mem_array(s->link_count + 1, sizeof *left), count = s->link_count, before;
    uint32_t root[2];
    for (size_t i = 0; i < count; i++)
        left[i] = i;
    do {
        before = count;
        count = 0;
        for (size_t i = 0; i < before; i++) {
            roots_of(s, left[i], root);
            if (!is_core[root[0]] && !is_core[root[1]]) {
                left[count++] = left[i];
            } else if (!is_core[root[0]] || !is_core[root[1]]) {
                regions_join(&s->regions, root[0], root[1], 0.0f);
                is_core[regions_root(&s->regions, root[0])] = true;
            }
        }
    } while (count < before);
    for (size_t i = 0; i < count; i++) {
        roots_of(s, left[i], root);
        if (root[0] != root[1])
            regions_join(&s->regions, root[0], root[1], 0.0f);
    }
    mem_free(left);
}

void color_regions_find(struct color_regions *s, const struct mesh *mesh, const struct adjacency *adjacency,
                        const uint32_t *of_triangle, rgb *value, double least_area) {
    *s = (struct color_regions){.mesh = mesh, .adjacency = adjacency, .of_triangle = of_triangle, .value = value};
    bool *is_core = mem_array(mesh->triangle_count, sizeof *is_core);
    regions_init(&s->regions, mesh);
    make_links(s);
    regions_join_by_weight(&s->regions, adjacency, s->link, s->link_count, mesh_area(mesh));
    keep_cores(s, least_area, is_core);
    grow_cores(s, is_core);
    mem_free(is_core);
}

void color_regions_release(struct color_regions *s) {
    mem_free(s->link);
    regions_release(&s->regions);
    mem_free(s->value);
}
