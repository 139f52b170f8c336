/* saturated_light.h -- how bright lamps and skies are at which every photograph saturates.
 *
 * An ordinary photograph is exposed for the room: its lamps and windows are white, and how much brighter than white
 * they are no frame tells unless some are much shorter than others. Left at that lower bound they light the room too
 * little by as much, and all that they light comes out too white. What they light tells (lamps.h). A sky is one lamp
 * here; one of which photographs show half or more as it is stays as it is. */
#ifndef UNBAKE_LIGHT_SATURATED_LIGHT_H
#define UNBAKE_LIGHT_SATURATED_LIGHT_H

#include "server/capture/views.h"
#include "server/state/reconstruction.h"

/* What was seen must be fused, and the world be lit by r->environment, if it has a map. Fills r->evidence of such
 * segments, with `unbound`, and changes such directions of the map. The report says how much brighter they were
 * made ("saturated_light"). Does nothing where there are none. The same for any number of threads. */
void saturated_light_estimate(struct reconstruction *r, const struct views *views);

#endif
