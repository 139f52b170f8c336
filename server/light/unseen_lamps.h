/* unseen_lamps.h -- lamps where a scan has no surface: behind a cornice, under a cupboard, above a lintel.
 *
 * The border of what photographs do not show (capture/unseen_space.h) is in their place. Parts of it are tried as lamps
 * beside the segments that no photograph shows (hidden_lamps.h), and those for which the evidence suffices are added to
 * the mesh. From then on they are such segments. */
#ifndef UNBAKE_LIGHT_UNSEEN_LAMPS_H
#define UNBAKE_LIGHT_UNSEEN_LAMPS_H

#include "server/capture/views.h"
#include "server/state/reconstruction.h"

/* Needs fused radiance, and a world lit by r->environment if that has a map. Does nothing to meshes that tell objects
 * apart, where what is modelled is meant, or that are closed, and lack nothing; nor with holes=keep. Returns the number
 * of quads that were added (added_surface.h); if there are any, what was made of mesh and segments must be made again.
 * The same for any number of threads. */
size_t unseen_lamps_find(struct reconstruction *r, const struct views *views);

#endif
