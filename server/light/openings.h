/* openings.h -- light that comes in through what a scan lacks, as sources that have a place.
 *
 * Where holes of a scan were filled, and what photographs show through the mesh is no brighter than white paint
 * would be in the room, nothing that is open is a window to a sky that lights it. The unseen part of the sky is made
 * dark, and the cells of a box around the scan (surround.h) are fitted in its place, together with all other sources
 * (light_model.h). Those of which surfaces tell become surface, one segment each, at the end of mesh and segments:
 * lamps of the kind ESTIMATED_OPENING from then on. What photographs show through the gaps stays distant light.
 *
 * Limits: a source behind a gap lies farther away than it is; a light that several cells share is spread over them. */
#ifndef UNBAKE_LIGHT_OPENINGS_H
#define UNBAKE_LIGHT_OPENINGS_H

#include "server/capture/views.h"
#include "server/state/reconstruction.h"

/* Needs fused radiance, and a world lit by r->environment if that has a map. Does nothing unless r->is_surrounded. Sets
 * r->opening_count, and returns it: where it is not 0, the mesh's arrays may have moved, and what was made of mesh and
 * segments must be made again. The same for any number of threads. */
size_t openings_find(struct reconstruction *r, const struct views *views);

#endif
