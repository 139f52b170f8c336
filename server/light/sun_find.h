/* sun_find.h -- looks for a sun that no photograph shows, by the patches that it lights.
 *
 * Photographs of a room seldom look into the sun, yet its light on a floor is the brightest thing in many.
 * Without it the patch would be taken for a white floor, or for a lamp. At each of some thousand points what
 * photographs show is base colour times (light that is known + sun), and base colours differ little within a
 * segment and are never above that of white paint: a sun of the right direction, size and strength makes them
 * so. First every unseen direction is asked whether what is bright for its segment sees it, and what is not does
 * not; then the likeliest ones are fitted, and the best one is taken if it explains a good part of what was
 * odd about the points that it lights. */
#ifndef UNBAKE_LIGHT_SUN_FIND_H
#define UNBAKE_LIGHT_SUN_FIND_H

#include "server/capture/views.h"
#include "server/state/reconstruction.h"

/* What was seen must be fused and the world be lit by r->environment, if it has a map. Fills r->sun; the report says
 * what was found ("sun"). The same for any number of threads. */
void sun_find(struct reconstruction *r, const struct views *views);

/* Adds to the report where the sun that was found stands and how strong it is by now. */
void sun_report(const struct reconstruction *r);

#endif
