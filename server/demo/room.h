/* room.h -- the demo room: a closed, furnished room with known materials and lights.
 *
 * Modelled after the controlled scene of Nimier-David et al. 2021, section 6: textured walls, floor and ceiling, a
 * table, a door panel, shelves with objects, a glossy vase, a patterned carpet, pictures, an emitter on a wall and
 * one at the ceiling with adjustable radiances. 5 x 2.8 x 4 m, y up, one object_id per object. */
#ifndef UNBAKE_DEMO_ROOM_H
#define UNBAKE_DEMO_ROOM_H

#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/parallel.h"
#include "server/demo/objects.h"
#include "server/demo/shapes.h"
#include "server/render/world.h"
#include "server/scene/atlas.h"
#include "server/scene/inverse_uv.h"
#include "server/scene/materials.h"
#include "server/scene/segment.h"

struct room {
    struct mesh mesh;
    struct segments segments; /* segment number = object_id */
    struct atlas atlas;
    struct inverse_uv inverse;
    struct materials materials;
    struct world world;
};

/* Static storage. */
const char *room_object_name(enum room_object object);

/* Bounding boxes of the furniture, which cameras avoid; [*count], static storage. */
const vec3 (*room_obstacles(size_t *count))[2];

enum room_lamps {
    ROOM_LAMPS_FRAMED,  /* panels before wall and ceiling, their frames stand out */
    ROOM_LAMPS_OPENING, /* so, but the wall is open behind its emitter, a window: without it one looks out of the room */
    ROOM_LAMPS_FLUSH    /* in the planes of wall and ceiling, frames too, as lamps of offices are */
};

/* What of a room can be chosen. */
struct room_look {
    uint32_t texture_size; /* texels a side */
    float wall_radiance, ceiling_radiance;
    enum room_lamps lamps;
};

/* Builds geometry, textures, and the acceleration structure. */
enum status room_init(struct room *room, const struct room_look *look, struct parallel *pool, struct error *err);
void room_release(struct room *room);

#endif
