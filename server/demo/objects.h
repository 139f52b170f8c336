/* objects.h -- the objects of the demo room, by object_id, and the room's size. */
#ifndef UNBAKE_DEMO_OBJECTS_H
#define UNBAKE_DEMO_OBJECTS_H

#define ROOM_WIDTH 5.0f  /* metres along x */
#define ROOM_HEIGHT 2.8f /* along y */
#define ROOM_DEPTH 4.0f  /* along z */

enum room_object {
    ROOM_FLOOR,
    ROOM_CEILING,
    ROOM_WALL_WEST,
    ROOM_WALL_EAST,
    ROOM_WALL_NORTH,
    ROOM_WALL_SOUTH,
    ROOM_CARPET,
    ROOM_TABLE_TOP,
    ROOM_TABLE_LEGS,
    ROOM_DOOR,
    ROOM_DOOR_FRAME,
    ROOM_SHELVES,
    ROOM_BOOKS,
    ROOM_GLOBE,
    ROOM_CHEST,
    ROOM_VASE,
    ROOM_PAINTING_LARGE,
    ROOM_PAINTING_SMALL,
    ROOM_PICTURE_FRAMES,
    ROOM_SOFA,
    ROOM_LAMP_FRAMES,
    ROOM_WALL_EMITTER,
    ROOM_CEILING_EMITTER,
    ROOM_OBJECT_COUNT
};

#endif
