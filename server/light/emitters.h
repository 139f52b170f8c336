/* emitters.h -- what photographs show of each segment's light, before it is known what emits. */
#ifndef UNBAKE_LIGHT_EMITTERS_H
#define UNBAKE_LIGHT_EMITTERS_H

#include "server/capture/views.h"
#include "server/state/evidence.h"
#include "server/state/reconstruction.h"

/* Fills `radiance`, `observed`, `saturated`, `is_seen`, `only_mixed` and `is_outshone` of evidence[segment_count] from
 * up to a few hundred texels of each; nothing of hidden lamps, no `radiance` of saturated lamps that is estimated. */
void emitters_observe(const struct reconstruction *r, const struct views *views, struct emitter_evidence *evidence);

/* Whether a segment of this radiance outshines a room of that median. */
bool emitters_outshine(float radiance, float median_radiance);

/* Makes lights of what outshines the room, before it is known what emits: its emission is its observed radiance, own
 * and reflected light together; that of all else is 0. */
void emitters_light_bright(struct reconstruction *r, const struct views *views,
                           const struct emitter_evidence *evidence);

#endif
