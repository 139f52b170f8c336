/* regions.h -- triangles joined to regions over the links between them.
 *
 * Graph segmentation (Felzenszwalb and Huttenlocher 2004) as used for scans by Dai et al. 2017 (ScanNet): two regions
 * are joined over a link no heavier than the heaviest inside either of them plus a bonus for small regions. What a link
 * weighs is the caller's. Changes to the published method: sizes are areas, since triangles of a modelled room differ
 * by a factor of millions. */
#ifndef UNBAKE_SCENE_REGIONS_H
#define UNBAKE_SCENE_REGIONS_H

#include <stddef.h>
#include <stdint.h>

#include "server/scene/adjacency.h"
#include "server/scene/mesh.h"

/* Two triangles that share an edge. */
struct region_link {
    float weight;
    uint32_t half_edge; /* of the one; the next of its ring is of the other */
};

/* Disjoint sets of triangles (union by area, path halving). */
struct regions {
    size_t triangle_count;
    uint32_t *parent; /* [triangle_count]; owned, as all */
    double *area;     /* [triangle_count] of a root: m^2 */
    float *inside;    /* [triangle_count] of a root: greatest weight joined inside */
};

/* Each triangle alone. */
void regions_init(struct regions *r, const struct mesh *mesh);
void regions_release(struct regions *r);

uint32_t regions_root(struct regions *r, uint32_t triangle);

/* Of two roots the one with the greater area stays one. */
void regions_join(struct regions *r, uint32_t a, uint32_t b, float weight);

/* The other triangle of a link. */
static inline uint32_t region_link_end(const struct adjacency *adjacency, const struct region_link *link) {
    return adjacency->next[link->half_edge] / 3;
}

/* By increasing weight, then half-edge. */
void regions_sort_links(struct region_link *link, size_t count);

/* Joins over sorted links. `total`: area of the mesh, by which the bonus is. */
void regions_join_by_weight(struct regions *r, const struct adjacency *adjacency, const struct region_link *link,
                            size_t count, double total);

#endif
