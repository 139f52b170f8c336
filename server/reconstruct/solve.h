/* solve.h -- materials and emitters from the measured light, without following a path.
 *
 * The photographs tell what every surface sends out (fuse.h), so one bounce tells what arrives
 * (probes.h); from both follow, in closed form or by a search over few numbers, which segments emit
 * (emitters.h), how glossy they are (specular_fit.h) and their base colour (divide.h). What no photograph
 * saw is filled in and sends out light from then on. Done three times: then with the emitters known,
 * and gloss, and at last of every texel and with more rays.
 *
 * The order of ideas is that of FIPT (Wu et al. 2023) and TexIR (Li et al. 2023); in texture space,
 * with the exact Disney lobes and without a network. */
#ifndef UNBAKE_RECONSTRUCT_SOLVE_H
#define UNBAKE_RECONSTRUCT_SOLVE_H

#include "common/error.h"
#include "server/capture/views.h"
#include "server/state/reconstruction.h"

/* Writes r->materials, r->is_emitter, r->evidence and the lights of r->world, and adds "solve" to
 * r->report. STATUS_CANCELLED when stopped: nothing is usable then. Deterministic. */
enum status solve_run(struct reconstruction *r, const struct views *views,
                      const struct reconstruct_hooks *hooks, struct error *err);

#endif
