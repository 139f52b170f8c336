/* overlay.h -- the mesh's edges over a photograph: where they lie on those of the picture, mesh and pose fit.
 *
 * Rays at half the picture's resolution give the depth. Of a plane, the inverse of the depth along the axis is linear
 * in the picture: edges of depth and creases are where it bends, more than the mesh's own noise. */
#ifndef UNBAKE_CHECK_OVERLAY_H
#define UNBAKE_CHECK_OVERLAY_H

#include "server/check/drawing.h"
#include "server/render/accel.h"
#include "server/scene/photograph.h"

#define OVERLAY_SIZE 640    /* pixels of the longer side, at most */
#define OVERLAY_ENLARGED 10 /* times the photograph's, at most */

/* Draws the photograph in grey, the edges in colour, and a tint where rays meet no surface. `camera` is the
 * photograph's, or another one of the same size. *drawing is the caller's (drawing_release). */
void overlay_draw(struct drawing *drawing, const struct photograph *photo, const struct camera *camera,
                  const struct accel *accel);

#endif
