/* rough_mesh.h -- meshes without normals, as a scanner leaves them: every vertex off by its own. */
#ifndef UNBAKE_TESTS_ROUGH_MESH_H
#define UNBAKE_TESTS_ROUGH_MESH_H

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "common/mem.h"
#include "common/rng.h"
#include "server/scene/mesh.h"

#define ROUGH_SIDE 32 /* squares along each side of a sheet */
#define ROUGH_RINGS 16

/* Makes room for so many more. */
static inline void rough_grow(struct mesh *m, size_t vertices, size_t triangles) {
    m->position = mem_realloc_array(m->position, m->vertex_count + vertices, sizeof *m->position);
    m->index = mem_realloc_array(m->index, m->triangle_count + triangles, sizeof *m->index);
}

static inline void rough_triangle(struct mesh *m, uint32_t a, uint32_t b, uint32_t c) {
    uint32_t corner[3] = {a, b, c};
    memcpy(m->index[m->triangle_count++], corner, sizeof corner);
}

/* A sheet of (ROUGH_SIDE + 1)^2 vertices; those that coincide with the other sheet's are given twice. */
static inline void rough_sheet(struct mesh *m, vec3 u, vec3 v, float roughness) {
    uint32_t first = (uint32_t)m->vertex_count;
    vec3 up = vec3_normalize(vec3_cross(u, v));
    for (uint32_t j = 0; j <= ROUGH_SIDE; j++) {
        for (uint32_t i = 0; i <= ROUGH_SIDE; i++) {
            /* The edge itself is straight: the two sheets share it. */
            float off = j == 0 ? 0.0f : roughness * (2.0f * rng_to_float((uint32_t)rng_key(7, i, j)) - 1.0f);
            vec3 p = vec3_mad(vec3_scale(u, (float)i), (float)j, v);
            m->position[m->vertex_count++] = vec3_mad(p, off, up);
        }
    }
    for (uint32_t j = 0; j < ROUGH_SIDE; j++) {
        for (uint32_t i = 0; i < ROUGH_SIDE; i++) {
            uint32_t a = first + j * (ROUGH_SIDE + 1) + i;
            rough_triangle(m, a, a + 1, a + ROUGH_SIDE + 2);
            rough_triangle(m, a, a + ROUGH_SIDE + 2, a + ROUGH_SIDE + 1);
        }
    }
}

/* A floor, that faces y, and a wall, that faces z. */
static inline void rough_sheets(struct mesh *m, float roughness) {
    *m = (struct mesh){0};
    rough_grow(m, 2 * (ROUGH_SIDE + 1) * (ROUGH_SIDE + 1), 4 * ROUGH_SIDE * ROUGH_SIDE);
    rough_sheet(m, (vec3){0.1f, 0, 0}, (vec3){0, 0, -0.1f}, roughness);
    rough_sheet(m, (vec3){0.1f, 0, 0}, (vec3){0, 0.1f, 0}, roughness);
}

/* A ball of radius 1 around the origin; it shares no vertex with what is there. */
static inline void rough_add_ball(struct mesh *m, float roughness) {
    uint32_t around = 2 * ROUGH_RINGS, first = (uint32_t)m->vertex_count;
    rough_grow(m, (ROUGH_RINGS + 1) * around, 2 * ROUGH_RINGS * around);
    for (uint32_t j = 0; j <= ROUGH_RINGS; j++) {
        for (uint32_t i = 0; i < around; i++) {
            float theta = 3.14159265f * (float)j / ROUGH_RINGS, phi = 3.14159265f * (float)i / ROUGH_RINGS;
            bool is_pole = j == 0 || j == ROUGH_RINGS;
            float off = is_pole ? 0.0f : roughness * (2.0f * rng_to_float((uint32_t)rng_key(8, i, j)) - 1.0f);
            float r = is_pole ? 0.0f : sinf(theta);
            vec3 out = {r * cosf(phi), cosf(theta), r * sinf(phi)};
            m->position[m->vertex_count++] = vec3_scale(out, 1.0f + off);
        }
    }
    for (uint32_t j = 0; j < ROUGH_RINGS; j++) {
        for (uint32_t i = 0; i < around; i++) {
            uint32_t a = first + j * around + i, b = first + j * around + (i + 1) % around;
            if (j > 0)
                rough_triangle(m, a, b, b + around);
            if (j < ROUGH_RINGS - 1)
                rough_triangle(m, a, b + around, a + around);
        }
    }
}

#endif
