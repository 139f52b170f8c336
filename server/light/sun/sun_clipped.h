/* sun_clipped.h -- looks for a sun by where photographs saturate in its light.
 *
 * At one exposure the patches that a sun lights in a room are white in all photographs, and so is the sky in which it
 * stands. Neither has a radiance, and sun_find.h, which asks how bright places are, finds nothing; but where the edges
 * of these patches are is known. Places of one segment that lie near each other and face the same way differ in little
 * but that the sun reaches some of them: with the right direction those saturate, and the others do not.
 *
 * But a bright sky draws edges as well: beside a window's frame a place sees less of it than the next. How many places
 * of a patch saturate, s, tells of no sun; given s, place i is among them by its odds
 *
 *     w_i = (1 + S_i / S)^g ODDS^(it sees the direction)
 *
 * S_i is what a uniform sky brings that is as wide as all directions no photograph measures, S its mean over all
 * places: other light is taken for as much. That just the places C of a patch saturate has the probability
 *
 *     prod over C of w_i / e_s(w)        (conditional logistic regression: symmetric_sum.h)
 *
 * g is what makes the places that saturate likeliest without a sun, of all patches together. The evidence is the
 * logarithm of the ratio of the probabilities with a sun and without, summed over all patches. Whole walls that
 * saturate and dark things that do not say nothing. Places of a patch are no independent draws: it counts as at most
 * PLACES_ALIKE of them. A sun is there if its odds exceed 20 to 1 with one expected among all directions that could be
 * told, which are those that part some patch and that no photograph measures.
 *
 * Limits. One sun, of half a degree. How strong it is comes from the joint fit (sunlit.h). */
#ifndef UNBAKE_LIGHT_SUN_SUN_CLIPPED_H
#define UNBAKE_LIGHT_SUN_SUN_CLIPPED_H

#include "server/state/reconstruction.h"

/* Needs fused radiance, and the environment. Where there is such a sun it sets r->sun, of irradiance 0. The same for
 * any number of threads. */
void sun_clipped_find(struct reconstruction *r);

#endif
