/* insert_objects.h -- puts virtual objects into a recovered room: their triangles behind the room's, a segment for each
 * of their materials, and their texels below those of the room's textures. */
#ifndef UNBAKE_RELIGHT_INSERT_OBJECTS_H
#define UNBAKE_RELIGHT_INSERT_OBJECTS_H

#include "server/relight/recovered.h"
#include "server/relight/virtual_objects.h"

/* STATUS_LIMIT where the textures would be higher than a picture may be. */
enum status insert_objects(const struct virtual_objects *objects, struct recovered *room, struct mesh *mesh,
                           struct error *err);

/* Name of the added segment number i, "lamp_1", or "insert_2_0" of several; the caller's. */
char *insert_objects_name(const struct virtual_objects *objects, size_t i);

#endif
