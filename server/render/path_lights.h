/* path_lights.h -- which light each vertex of a block samples. */
#ifndef UNBAKE_RENDER_PATH_LIGHTS_H
#define UNBAKE_RENDER_PATH_LIGHTS_H

#include <stdbool.h>

#include "server/render/shade.h"
#include "server/render/world.h"

/* Chooses a light triangle for each of `count` lanes by s->pick and loads it; lanes that choose the environment are
 * left to path_lights_environment. False when the scene has no light. */
bool path_lights_pick(struct shade_block *s, struct vertex_block *v, const struct world *world, int count);

/* The samples on triangles of segments with an emission cone. After shade_light. */
void path_lights_cones(struct shade_block *s, const struct vertex_block *v, const struct materials *materials,
                       int count);

/* Light samples of the lanes that chose the environment. After shade_light. */
void path_lights_environment(struct shade_block *s, struct vertex_block *v, const struct lights *lights, int count);

#endif
