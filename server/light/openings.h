/* openings.h -- light that comes in through what a scan lacks, as sources that have a place.
 *
 * Where holes of a scan were filled, and what photographs show through the mesh is no brighter than white paint would
 * be in the room, nothing that is open is a window to a sky that lights it. There is no distant light then: the cells
 * of a box around the scan (surround.h) are in its place. Those that photographs look at through the mesh become
 * surface, which shows what they show. The others are fitted together with all other sources (light_model.h), and those
 * for which there is evidence become surface, too: lamps of the kind ESTIMATED_OPENING. Each is a segment, at the end
 * of mesh and segments, the lamps last. The rest of the box stays open and dark. Not where most of the room was not
 * scanned (UNSEEN_LIGHT_MOSTLY): a few lamps in much darkness do not light it as what stands there does.
 *
 * Limits: a source behind a gap lies farther away than it is; a light that several cells share is spread over them. */
#ifndef UNBAKE_LIGHT_OPENINGS_H
#define UNBAKE_LIGHT_OPENINGS_H

#include "server/capture/views.h"
#include "server/state/reconstruction.h"

/* Needs fused radiance, and a world lit by r->environment if that has a map. Does nothing unless r->is_surrounded,
 * which it takes back where most of the room was not scanned. Sets r->openings and r->light.source, takes
 * r->environment away, and returns the number of new segments, each a quad (added_surface.h), the last ones of the
 * mesh. Where there are any, the mesh's arrays may have moved, and what was made of mesh and segments must be made
 * again. The same for any number of threads. */
size_t openings_find(struct reconstruction *r, const struct views *views);

#endif
