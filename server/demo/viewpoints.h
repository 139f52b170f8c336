/* viewpoints.h -- where the demo room is photographed from.
 *
 * Of many random candidates, clear of the furniture, those are taken one by one that add most to
 * how well the room's surface is seen. Deterministic in the seed. */
#ifndef UNBAKE_DEMO_VIEWPOINTS_H
#define UNBAKE_DEMO_VIEWPOINTS_H

#include <stddef.h>
#include <stdint.h>

#include "server/demo/room.h"
#include "server/scene/camera.h"

/* Fills camera[train_count + test_count], the training ones first: pinholes of width x height
 * pixels and 75 degrees across. Test cameras look at what training cameras see, from elsewhere. */
void viewpoints_choose(const struct room *room, uint32_t width, uint32_t height,
                       size_t train_count, size_t test_count, uint64_t seed,
                       struct camera *camera);

#endif
