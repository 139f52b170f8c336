/* face_normals.h -- the normals of a rough mesh's triangles, with the roughness filtered out.
 *
 * Those of triangles that share a corner are averaged, like with like (the bilateral filter of normals, Zheng et al.
 * 2011), the wider the rougher the mesh is. Edges stay, and what is plane stays so to the bit. */
#ifndef UNBAKE_SCENE_FACE_NORMALS_H
#define UNBAKE_SCENE_FACE_NORMALS_H

#include "common/parallel.h"
#include "server/scene/mesh.h"

struct face_normals {
    vec3 *normal;        /* [triangle_count] unit, filtered */
    float *area;         /* [triangle_count] twice the area, m^2 */
    uint32_t *weld;      /* [vertex_count] as mesh_weld has it */
    uint32_t *first;     /* [vertex_count + 1] the triangles at welded vertex v are ... */
    uint32_t *triangle;  /* ... those at [first[v], first[v + 1]) here, ascending */
    float least;         /* by how much at least each differs from a neighbour, median, before the filter: 0 of what was
                          * modelled by hand, whose walls have two triangles */
    float roughness;     /* by how much neighbours' normals differ before the filter: length of the difference; half
                          * of the triangles have a quarter of their neighbours nearer */
};

/* A mesh is rough enough to be worth the filter of normals. */
static inline bool face_normals_rough(const struct face_normals *f) { return f->roughness > 0.005f; }

/* It is noise that makes it rough, not that it has few triangles. */
static inline bool face_normals_noisy(const struct face_normals *f) { return face_normals_rough(f) && f->least > 0.002f; }

/* Unit, of welded vertex v: the mean of its triangles' by area; 0 where it has none. */
vec3 face_normals_at(const struct face_normals *f, size_t v);

/* The same for any number of threads. */
void face_normals_init(struct face_normals *f, const struct mesh *mesh, struct parallel *pool);
void face_normals_release(struct face_normals *f);

#endif
