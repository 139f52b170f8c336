/* viewpoints.h -- camera positions for the demo room.
 *
 * Greedy choice among random candidates that are clear of the furniture: each time the one that most improves
 * coverage of the room's surfaces. Deterministic in the seed. */
#ifndef UNBAKE_DEMO_VIEWPOINTS_H
#define UNBAKE_DEMO_VIEWPOINTS_H

#include <stddef.h>
#include <stdint.h>

#include "server/demo/room.h"
#include "server/scene/camera.h"

/* Fills camera[train_count + test_count], training cameras first: pinhole cameras of width x height pixels and 75
 * degrees horizontal field of view. Test cameras look at what training cameras see, from other positions. */
void viewpoints_choose(const struct room *room, uint32_t width, uint32_t height, size_t train_count, size_t test_count,
                       uint64_t seed, struct camera *camera);

#endif
