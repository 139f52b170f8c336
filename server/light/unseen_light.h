/* unseen_light.h -- light from where nothing was scanned and no photograph looks.
 *
 * Few captures scan the ceiling, and there the lamps are. Rays that leave the mesh in directions that
 * no photograph shows find what environment.h filled in, a guess; surfaces would then look brighter
 * than any light explains, and lit tables be called emitters. How much light it takes is told by the
 * surfaces themselves: at each of some thousand points what the photographs show is base colour times
 * (light that is known + light that is not), and base colours are hardly ever above that of white paint
 * and differ little within a segment. Where the guess leaves a fifth of the points whiter than anything
 * can be, or most light is guessed, it is replaced by the coarse map of the unseen directions that makes
 * the base colours so, most probably (robust Gauss-Newton on its logarithm). Within some degrees of what is
 * seen the guess stays, the less the further away: what goes on behind a hole of the mesh is like what
 * photographs show of it. Of the colour of the rest nothing can be known apart from that of the surfaces:
 * photographs are balanced to make light white. */
#ifndef UNBAKE_LIGHT_UNSEEN_LIGHT_H
#define UNBAKE_LIGHT_UNSEEN_LIGHT_H

#include "server/capture/views.h"
#include "server/state/reconstruction.h"

/* What was seen must be fused, and the world be lit by r->environment if it has a map. Changes the part
 * of that map that was filled in, or makes one, unless the guess will do or hardly a ray leaves the room
 * that way (r->unseen_share); the report says so in either case ("unseen_light"). The same for any number
 * of threads. */
void unseen_light_estimate(struct reconstruction *r, const struct views *views);

#endif
