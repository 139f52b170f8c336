/* added_surface.h -- surface that the estimate of light adds to the mesh, so that light comes from there. */
#ifndef UNBAKE_LIGHT_ADDED_SURFACE_H
#define UNBAKE_LIGHT_ADDED_SURFACE_H

#include "server/state/reconstruction.h"

/* Adds quads of four corners, counter-clockwise from the front, at the end of the mesh, as one segment, the last one,
 * with an id of its own; all that have one name can be taken away by it. Returns the segment's number. The mesh's
 * arrays may be moved. */
#define ADDED_TRIANGLES 2 /* of a quad */
uint32_t added_surface_segment(struct reconstruction *r, const char *name, const vec3 (*corner)[4], size_t quads);

#endif
