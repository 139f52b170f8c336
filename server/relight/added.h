/* added.h -- puts things into a recovered room: their triangles behind the room's, a segment for each of their
 * materials, and their texels below those of the room's textures. */
#ifndef UNBAKE_RELIGHT_ADDED_H
#define UNBAKE_RELIGHT_ADDED_H

#include "server/relight/recovered.h"
#include "server/relight/things.h"

/* STATUS_LIMIT where the textures would be higher than a picture may be. */
enum status added_put(const struct things *things, struct recovered *room, struct mesh *mesh, struct error *err);

/* Name of the added segment number i, "lamp_1", or "insert_2_0" of several; the caller's. */
char *added_name(const struct things *things, size_t i);

#endif
