/* room_planes.h -- the planes that most of a room's surface lies in: walls, floors, ceilings, wide shelves.
 *
 * Found one after another by random sample consensus (Fischler & Bolles 1981) among points spread evenly over the
 * surface, with their normals; each is fitted to its points by least squares. */
#ifndef UNBAKE_HOLES_ROOM_PLANES_H
#define UNBAKE_HOLES_ROOM_PLANES_H

#include "server/scene/mesh.h"

#define ROOM_PLANES_MAX 16

struct room_plane {
    vec3 origin, normal; /* metres; unit, towards the front */
    vec3 s, t;           /* orthonormal with the normal */
    double share;        /* of the mesh's surface */
};

/* Up to ROOM_PLANES_MAX planes, widest first; `reach_m` is how far off a plane its surface may lie. Returns their
 * number. Deterministic. */
size_t room_planes_find(const struct mesh *mesh, float reach_m, struct room_plane plane[ROOM_PLANES_MAX]);

static inline float room_plane_height(const struct room_plane *plane, vec3 point) {
    return vec3_dot(plane->normal, vec3_sub(point, plane->origin));
}

#endif
