/* sun_clipped.h -- looks for a sun by where photographs saturate in its light.
 *
 * At one exposure the patches that a sun lights in a room are white in all photographs, and so is the sky in which it
 * stands. Neither has a radiance, and sun_find.h, which asks how bright places are, finds nothing; but where the edges
 * of these patches are is known. Places of one segment that lie near each other and face the same way differ in little
 * but that the sun reaches some of them: with the right direction those saturate, and the others do not.
 *
 * Of m places of such a patch s saturate, t see the direction, k do both. Given m, s and t, of which none tells of a
 * sun, k is hypergeometric without it. With it the odds that a place saturates are ODDS times those in its shade, and
 *
 *     P(k) ~ C(s, k) C(m - s, t - k) ODDS^k        (Fisher's noncentral hypergeometric distribution)
 *
 * The evidence is the logarithm of the ratio of both, summed over all patches. Whole walls that saturate, dark things
 * that do not, and what a bright sky brings to all sides of a patch say nothing. Places of a patch are no independent
 * draws: it counts as at most PLACES_ALIKE of them. A sun is there if its odds exceed 20 to 1 with one expected among
 * all directions that no photograph measures; and 20 to 1 over the likeliest direction elsewhere: the edge of a window
 * before a bright sky makes places saturate likewise, but all directions through it explain that about as well.
 *
 * Limits. One sun, of half a degree. How strong it is comes from the joint fit (sunlit.h).
 *
 * Fisher 1935, The logic of inductive inference (the distribution). */
#ifndef UNBAKE_LIGHT_SUN_SUN_CLIPPED_H
#define UNBAKE_LIGHT_SUN_SUN_CLIPPED_H

#include "server/state/reconstruction.h"

/* Needs fused radiance, and the environment. Where there is such a sun it sets r->sun, of irradiance 0. The same for
 * any number of threads. */
void sun_clipped_find(struct reconstruction *r);

#endif
