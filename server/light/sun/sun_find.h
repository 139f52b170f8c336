/* sun_find.h -- looks for a sun that no photograph shows, by the patches that it lights, unless there is one already.
 *
 * Photographs of a room seldom look into the sun, yet its light on a floor is the brightest thing in many. Without it
 * the patch would be taken for white paint, or for a lamp. At some thousand places observed radiance is base colour
 * times (known light + sun); base colours differ little within a segment and do not exceed that of white paint, and a
 * sun of the right direction, size and strength makes them so. First each unseen direction is scored by the residuals
 * of the places that see it; then the likeliest ones are fitted, and the best one is taken if it removes most of the
 * misfit of the places that it lights. */
#ifndef UNBAKE_LIGHT_SUN_SUN_FIND_H
#define UNBAKE_LIGHT_SUN_SUN_FIND_H

#include "server/capture/views.h"
#include "server/state/reconstruction.h"

/* Needs fused radiance, and a world lit by r->environment if that has a map. Fills r->sun; the report says what was
 * found ("sun"). The same for any number of threads. */
void sun_find(struct reconstruction *r, const struct views *views);

/* Adds to the report where the sun that was found stands and how strong it is by now. */
void sun_report(const struct reconstruction *r);

#endif
