/* adjacency.h -- which triangles meet at which edges.
 *
 * Edges are matched by the places of their ends, not by vertex numbers: files repeat vertices
 * where normals differ. Half-edge 3 t + e is the edge of triangle t from its corner e to its
 * corner (e + 1) % 3. Any number of triangles may share an edge, with any winding. */
#ifndef UNBAKE_SCENE_ADJACENCY_H
#define UNBAKE_SCENE_ADJACENCY_H

#include <stdbool.h>
#include <stdint.h>

#include "server/scene/mesh.h"

struct adjacency {
    uint32_t *weld; /* [vertex_count] as mesh_weld gives it; owned */
    uint32_t *next; /* [3 * triangle_count] the next half-edge on the same edge, in a ring of
                     * ascending numbers; itself where no other triangle meets it; owned */
};

void adjacency_make(struct adjacency *adjacency, const struct mesh *mesh);
void adjacency_release(struct adjacency *adjacency);

/* Whether at each edge of the mesh two triangles meet or more: it has no border, so that no surface is missing. */
bool adjacency_is_closed(const struct adjacency *adjacency, const struct mesh *mesh);

/* Unit normals of the triangles, averaged over a few rings of neighbours but not across creases:
 * the noise of a scan goes, the shape of a model stays. [triangle_count], the caller's
 * (mem_free). */
vec3 *adjacency_smooth_normals(const struct adjacency *adjacency, const struct mesh *mesh);

#endif
