/* world.h -- the scene as rays see it: geometry, materials, lights. */
#ifndef UNBAKE_RENDER_WORLD_H
#define UNBAKE_RENDER_WORLD_H

#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/image.h"
#include "common/parallel.h"
#include "common/vec.h"
#include "server/render/accel.h"
#include "server/render/guide.h"
#include "server/render/light.h"
#include "server/scene/atlas.h"
#include "server/scene/materials.h"
#include "server/scene/mesh.h"
#include "server/scene/segment.h"

/* Shading data of a triangle, in one cache line. */
struct world_triangle {
    vec3 normal;           /* unit, geometric */
    float plane;           /* normal . p for points p of the triangle */
    vec2 corner[3];        /* atlas coordinates, texels */
    int16_t shading[3][3]; /* unit vertex normals, times 32767; 0: the mesh has none */
    int16_t pad;           /* read with the last normal */
    uint32_t segment;
};

struct world {
    const struct mesh *mesh; /* borrowed, all five */
    const struct segments *segments;
    const struct atlas *atlas;
    const struct materials *materials; /* may change between batches; then call world_update_lights */
    struct parallel *pool;             /* makes the guide */
    struct world_triangle *triangle;   /* [triangle_count] owned */
    struct accel *accel;               /* owned */
    struct lights *lights;             /* owned */
    struct guide *guide;               /* NULL: lights are sampled by power; owned */
};

/* Builds the acceleration structure and the light tables. environment, a map in the layout of latlong.h, is copied;
 * NULL: black. The other arguments are borrowed until world_release and must not change, except for the contents of
 * materials. */
enum status world_init(struct world *world, const struct mesh *mesh, const struct segments *segments,
                       const struct atlas *atlas, const struct materials *materials, const struct image *environment,
                       struct parallel *pool, struct error *err);
void world_release(struct world *world);

/* Replaces the environment by a copy of another (NULL: none) and measures its visibility. */
void world_set_environment(struct world *world, const struct image *environment, struct parallel *pool);

/* Takes over changed emission. If the set of emitting segments changed, the guide is rebuilt, in a fraction of a
 * second, by the pool: not to be called from a body of it. */
void world_update_lights(struct world *world);

#endif
