/* orient.h -- which side of the surface is its front.
 *
 * The front of a triangle is where its corners run counter-clockwise, and only fronts are measured and
 * emit. Scans keep to that, models made by hand often do not: whole objects are inside out. Photographs
 * tell: what they see of a connected piece of one object more from behind than from the front is turned. */
#ifndef UNBAKE_CAPTURE_ORIENT_H
#define UNBAKE_CAPTURE_ORIENT_H

#include <stddef.h>

#include "common/error.h"
#include "common/parallel.h"
#include "server/scene/scene.h"

/* Turns triangles of scene->mesh, and the shading normals of vertices that no other triangle has.
 * Only the poses of photographs that are not held out count. *turned: how many triangles. Deterministic, for any
 * number of threads. Fails as accel_new does. */
enum status orient_mesh(struct scene *scene, struct parallel *pool, size_t *turned, struct error *err);

#endif
