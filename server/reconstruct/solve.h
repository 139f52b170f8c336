/* solve.h -- materials and emitters from observed radiance, without path tracing.
 *
 * Photographs give the outgoing radiance of every surface (fuse.h), so one ray gives incident radiance (probes.h). From
 * both follow, in closed form or by a small search, which segments emit (emitters.h), their specular lobes
 * (specular_fit.h) and base colour (divide.h). Unobserved surfaces are filled in and contribute from then on. Three
 * passes: without lobes; with lobes; and at full resolution with more rays.
 *
 * After FIPT (Wu et al. 2023) and TexIR (Li et al. 2023), in texture space, with exact Disney lobes and without a
 * network. */
#ifndef UNBAKE_RECONSTRUCT_SOLVE_H
#define UNBAKE_RECONSTRUCT_SOLVE_H

#include "common/error.h"
#include "server/capture/views.h"
#include "server/state/pace.h"
#include "server/state/reconstruction.h"

/* Writes r->materials, r->is_emitter, r->evidence and the lights of r->world, and adds "solve" to r->report.
 * STATUS_CANCELLED when stopped: the result is unusable then. Deterministic. */
enum status solve_run(struct reconstruction *r, const struct views *views, const struct pace *pace, struct error *err);

#endif
