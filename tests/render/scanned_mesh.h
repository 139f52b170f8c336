/* scanned_mesh.h -- surfaces in even triangles, as fused depth maps have them; no objects told. */
#ifndef UNBAKE_TESTS_RENDER_SCANNED_MESH_H
#define UNBAKE_TESTS_RENDER_SCANNED_MESH_H

#include <math.h>
#include <string.h>

#include "server/scene/mesh.h"

/* A quad in pieces of about so many metres; for its vertices and triangles there is memory. */
static inline void add_scanned(struct mesh *m, float side_m, vec3 corner, vec3 u, vec3 v) {
    uint32_t columns = (uint32_t)lrintf(vec3_length(u) / side_m), rows = (uint32_t)lrintf(vec3_length(v) / side_m);
    uint32_t first = (uint32_t)m->vertex_count;
    for (uint32_t k = 0; k < (columns + 1) * (rows + 1); k++) {
        vec3 along = vec3_mad(corner, (float)(k % (columns + 1)) / (float)columns, u);
        m->position[m->vertex_count++] = vec3_mad(along, (float)(k / (columns + 1)) / (float)rows, v);
    }
    for (uint32_t k = 0; k < columns * rows; k++) {
        uint32_t a = first + k / columns * (columns + 1) + k % columns, up = a + columns + 1;
        const uint32_t two[2][3] = {{a, a + 1, up + 1}, {a, up + 1, up}};
        for (int t = 0; t < 2; t++) {
            size_t i = m->triangle_count++;
            memcpy(m->index[i], two[t], sizeof two[t]);
            m->face[i] = (uint32_t)i;
        }
    }
    m->face_count = m->triangle_count;
}

#endif
