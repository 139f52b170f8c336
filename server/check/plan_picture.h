/* plan_picture.h -- the room from above: walls, floor and furniture, the cameras, and what no photograph sees. */
#ifndef UNBAKE_CHECK_PLAN_PICTURE_H
#define UNBAKE_CHECK_PLAN_PICTURE_H

#include "common/parallel.h"
#include "server/check/drawing.h"
#include "server/render/accel.h"
#include "server/scene/scene.h"

/* *drawing is the caller's (drawing_release). *unseen_share: the part of the surface that no photograph sees. */
void plan_picture_draw(struct drawing *drawing, const struct scene *scene, const struct accel *accel,
                       struct parallel *pool, double *unseen_share);

#endif
