/* probes_refine.h -- more probes where gathered light turns out to vary from one to the next. */
#ifndef UNBAKE_GATHER_PROBES_REFINE_H
#define UNBAKE_GATHER_PROBES_REFINE_H

#include "server/gather/probes.h"

/* Part of the probes there are that each pass of solve but the first adds. Chosen on staircase2 and bathroom, where 1.5
 * gains no more than .1 dB on it (tests/FINDINGS.md). */
#define PROBES_REFINED_SHARE 0.75

/* Halves the blocks that gain most by it for each probe that it adds, until these are `share` of what there were: where
 * light varies from probe to probe beyond its noise, over surface that photographs see. All positions are chosen anew,
 * with light 0. */
void probes_refine(struct probes *p, double share, const struct mesh *mesh, const struct atlas *atlas,
                   const struct inverse_uv *inverse, const struct fused *fused);

#endif
