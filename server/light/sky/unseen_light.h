/* unseen_light.h -- estimates light from directions in which nothing was scanned, and that no photograph shows.
 *
 * Few captures scan the ceiling with its lamps. Rays that leave the mesh in unobserved directions meet the fill of
 * environment.h, an estimate by what is beside it; if it is too dark, lit surfaces look like emitters. The surfaces
 * determine how much light is missing: at each of some thousand points observed radiance is base colour times known
 * plus unknown light, and base colours rarely exceed that of white paint and vary little within a segment. Where the
 * fill leaves a fifth of the points with an implausible albedo, or most light is filled in, it is replaced by a fitted
 * coarse map (unseen_fit.h). Near observed directions the fill is kept, with a weight that falls over some degrees: the
 * scene behind a hole of the mesh resembles its surroundings. The map is grey: its colour cannot be separated from that
 * of the surfaces. */
#ifndef UNBAKE_LIGHT_SKY_UNSEEN_LIGHT_H
#define UNBAKE_LIGHT_SKY_UNSEEN_LIGHT_H

#include "server/capture/views.h"
#include "server/state/reconstruction.h"

/* Where more of all rays than this leave the room where nothing is known, most light is an estimate, and that of the
 * fit is the better one, however credible the fill looks (redkitchen .51; staircase2 .13, rooms with windows .02 at
 * most). */
#define UNSEEN_LIGHT_MOSTLY 0.3

/* Needs r->fused, and a world lit by r->environment if that has a map. Changes the filled-in part of the map, or makes
 * one, unless the fill suffices or hardly any ray leaves the room that way (r->unseen_share). Adds "unseen_light" to
 * the report. The same for any number of threads. */
void unseen_light_estimate(struct reconstruction *r, const struct views *views);

#endif
