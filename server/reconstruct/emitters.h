/* emitters.h -- the decision which segments emit.
 *
 * While the optimiser runs from a neutral start every segment may emit, and a push downwards makes
 * emission fade where reflected light explains the photographs as well. A segment is an emitter
 * when, at the time of the decision, its emission explains most of what the photographs show of
 * it: a reflecting surface keeps a small rest at most, a lamp nearly all of it. */
#ifndef UNBAKE_RECONSTRUCT_EMITTERS_H
#define UNBAKE_RECONSTRUCT_EMITTERS_H

#include "server/reconstruct/reconstruct.h"
#include "server/reconstruct/views.h"

/* Median radiance, by channel, that the photographs show of each segment, from up to a few hundred
 * texels of it; saturated values count as the clip. 0 where nothing was seen.
 * radiance[segment_count] out. */
void emitters_observe(const struct reconstruction *r, const struct views *views, rgb *radiance);

/* Fills is_emitter[segment_count] and share[segment_count], the part of the observed radiance that
 * the present emission explains: the evidence. */
void emitters_decide(const struct materials *materials, const rgb *observed_radiance,
                     bool *is_emitter, float *share);

#endif
