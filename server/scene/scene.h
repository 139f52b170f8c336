/* scene.h -- the content of a bundle: a mesh and photographs. */
#ifndef UNBAKE_SCENE_SCENE_H
#define UNBAKE_SCENE_SCENE_H

#include <stddef.h>

#include "common/reading.h"
#include "server/scene/coordinates.h"
#include "server/scene/mesh.h"
#include "server/scene/photograph.h"

struct scene {
    struct mesh mesh;
    struct mesh_report mesh_report; /* what was dropped of it */
    size_t photograph_count;
    struct photograph *photograph; /* [photograph_count]; owned */
    char *source;               /* kind of capture: "COLMAP"; NULL in scenes that were not read from a bundle; owned */
    size_t named_count;         /* frames that its files name, of which the photographs are those that can be used */
    enum matrix_axes pose_axes; /* what the matrices of the cameras' file were taken for */
    struct coordinates other[COORDINATES_MAX]; /* others than the poses', in which the mesh might be */
    size_t other_count;
    struct spill *spill; /* for arrays with an element for each pixel of all photographs; NULL: memory; borrowed */
    size_t warning_count;
    char **warning; /* [warning_count] sentences for the user; owned */
};

void scene_release(struct scene *scene);

/* The axis (x, y, z or a negative one) that points up in most photographs; inputs do not specify it. y if undecided. */
vec3 scene_up(const struct scene *scene);

#endif
