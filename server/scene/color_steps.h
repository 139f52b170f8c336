/* color_steps.h -- what parts two regions that meet: a step of colour, or a large one of brightness. */
#ifndef UNBAKE_SCENE_COLOR_STEPS_H
#define UNBAKE_SCENE_COLOR_STEPS_H

#include <stdbool.h>

#include "server/scene/color_regions.h"

/* Joins regions that meet without a step, the most alike first, each with one other at most; returns whether there were
 * any. Two are compared some triangles from their border, where each shows only itself; one that is too narrow by all
 * of it. */
bool color_steps_join(struct color_regions *s);

#endif
