/* orient.h -- finds the front of surfaces.
 *
 * The front of a triangle is the side from which its corners run counter-clockwise, and only fronts are measured and
 * emit. Scans follow that; models made by hand often do not, and whole objects are inside out. A connected piece of one
 * object that photographs see more from behind than from the front is flipped. */
#ifndef UNBAKE_CAPTURE_ORIENT_H
#define UNBAKE_CAPTURE_ORIENT_H

#include <stddef.h>

#include "common/error.h"
#include "common/parallel.h"
#include "server/scene/scene.h"

/* Flips triangles of scene->mesh, and the shading normals of vertices that no other triangle uses. Only training
 * photographs count. *turned: number of triangles. Deterministic, for any number of threads. Fails as accel_new does.
 */
enum status orient_mesh(struct scene *scene, struct parallel *pool, size_t *turned, struct error *err);

#endif
