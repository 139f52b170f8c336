/* lamp_find.h -- looks for lamps of the mesh that no photograph shows, by what they light.
 *
 * People photograph what is before them, and a ceiling lamp may be in none of the pictures. Without it all that
 * it lights is brighter than any light explains: whitish, uneven, and some of it a lamp, for all one knows. Each
 * segment of which nothing was seen is asked how much less odd the room would be if it shone (missing_light.h):
 * how the light of a lamp falls off, and what is in its shadow, tells which it is and how bright. The best one is
 * taken, then the next, for as long as they explain a good part of what is odd. */
#ifndef UNBAKE_LIGHT_LAMP_FIND_H
#define UNBAKE_LIGHT_LAMP_FIND_H

#include "server/capture/views.h"
#include "server/state/reconstruction.h"

/* What was seen must be fused and the world be lit by r->environment, if it has a map. Fills r->evidence, with
 * `hidden` for lamps that were found; the report says which ("hidden_lamps"). The same for any number of threads. */
void lamp_find(struct reconstruction *r, const struct views *views);

#endif
