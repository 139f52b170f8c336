/* hidden_holes.h -- holes of a scan that no photograph shows, as behind a sofa or under a cupboard.
 *
 * Scanners see as little there as cameras do, but light would come in from outside all the same. A cell of a room's
 * plane is part of such a hole if the mesh does not cover it, no pixel shows it or looks through it, and the surface is
 * all around: whichever way one goes along the plane, covered cells come before open ones, or the room ends there. Of
 * what lies beyond the room's walls, from where only backs are seen, nothing is filled. */
#ifndef UNBAKE_HOLES_HIDDEN_HOLES_H
#define UNBAKE_HOLES_HIDDEN_HOLES_H

#include "server/holes/hole_regions.h"

/* Appends them to `holes`, once hole_regions_find has found the others, and gives their cells their region's number;
 * those beside a hole that photographs show become a part of it. The mesh stays as it is (hole_surface.h adds to
 * it). */
void hidden_holes_add(struct hole_regions *holes, struct hole_grid *grid, const struct mesh *mesh,
                      const struct accel *accel);

#endif
