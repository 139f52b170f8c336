/* segment_names.h -- what automatic segments are called: after the object of the input that they lie in. */
#ifndef UNBAKE_SCENE_SEGMENT_NAMES_H
#define UNBAKE_SCENE_SEGMENT_NAMES_H

#include <stddef.h>
#include <stdint.h>

#include "server/scene/mesh.h"

/* Names of count segments, of_triangle[triangle_count] in [0, count): "wall" for the only segment within the object of
 * that name, "wall (1)", "wall (2)" in the order of their numbers where there are several; NULL for one that lies in no
 * named object or across several. An array and strings that are the caller's (mem_free); NULL: none has a name. */
char **segment_names_make(const uint32_t *of_triangle, size_t count, const struct mesh *mesh);

#endif
