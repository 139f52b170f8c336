/* face_normals.h -- triangle normals of a scanned mesh, without its noise.
 *
 * Bilateral normal filter (Zheng et al. 2011) over triangles that share a vertex; its width follows the roughness of
 * the mesh. Edges survive, and planar surfaces keep their normals bit by bit. */
#ifndef UNBAKE_SCENE_FACE_NORMALS_H
#define UNBAKE_SCENE_FACE_NORMALS_H

#include "common/parallel.h"
#include "server/scene/mesh.h"

struct face_normals {
    vec3 *normal;           /* [triangle_count] unit, filtered */
    float *area;            /* [triangle_count] twice the area, m^2 */
    uint32_t *weld;         /* [vertex_count] from mesh_weld */
    uint32_t *first;        /* [vertex_count + 1] the triangles of welded vertex v are */
    uint32_t *triangle;     /* those at [first[v], first[v + 1]), ascending */
    float least_difference; /* to the most similar adjacent normal, median over triangles, before filtering: 0 for
                             * modelled meshes, whose walls consist of pairs of coplanar triangles */
    float roughness;        /* difference of adjacent normals (length) before filtering: median over triangles of the
                          * lower quartile over neighbours */
};

/* Rough enough for the normals to be filtered. */
static inline bool face_normals_are_rough(const struct face_normals *f) { return f->roughness > 0.005f; }

/* Rough because of noise, and not only because triangles are large. */
static inline bool face_normals_are_noisy(const struct face_normals *f) {
    return face_normals_are_rough(f) && f->least_difference > 0.002f;
}

/* So rough that the filter cannot tell noise from edges: adjacent normals differ by 20 degrees. */
static inline bool face_normals_are_crumpled(const struct face_normals *f) { return f->roughness > 0.35f; }

/* Unit normal of welded vertex v: area-weighted mean over its triangles; 0 where it has none. */
vec3 face_normals_at(const struct face_normals *f, size_t v);

/* The result does not depend on the number of threads. */
void face_normals_init(struct face_normals *f, const struct mesh *mesh, struct parallel *pool);
void face_normals_release(struct face_normals *f);

#endif
