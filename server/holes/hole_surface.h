/* hole_surface.h -- the surface that closes holes: triangles that are added to the mesh.
 *
 * Two for each cell. Their corners lie as high over the plane as the mesh around, and as a membrane between; beside the
 * mesh they go on for a cell behind it, so that no light passes between the two. */
#ifndef UNBAKE_HOLES_HOLE_SURFACE_H
#define UNBAKE_HOLES_HOLE_SURFACE_H

#include "server/holes/hole_regions.h"
#include "server/scene/segment.h"

/* Adds them at the end of mesh and segments. They continue what is around: its segment, and its object_id where the
 * mesh has some; their face is MESH_NO_FACE. Returns the number of triangles. The mesh's arrays may be moved. */
size_t hole_surface_add(struct mesh *mesh, struct segments *segments, const struct hole_grid *grid,
                        const struct hole_regions *holes);

#endif
