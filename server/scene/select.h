/* select.h -- leaves out what a user does not want of a scene: photographs by name, and the mesh outside of a box. */
#ifndef UNBAKE_SCENE_SELECT_H
#define UNBAKE_SCENE_SELECT_H

#include <stddef.h>

#include "common/error.h"
#include "server/scene/scene.h"

/* Leaves out the photographs whose name, or its last part, matches one of `patterns` (fnmatch, separated by commas;
 * "" leaves out none); *left_out counts them. STATUS_INPUT when a pattern matches none. */
enum status scene_exclude(struct scene *scene, const char *patterns, size_t *left_out, struct error *err);

/* Leaves out the triangles whose centre lies outside of the box, in the input's coordinates (metres; mesh.h:
 * offset); *left_out counts them. Vertices stay. STATUS_INPUT when no triangle is left. */
enum status scene_crop(struct scene *scene, const double lower[3], const double upper[3], size_t *left_out,
                       struct error *err);

#endif
