/* sun_seen.h -- takes a sun that photographs show out of the map of distant light.
 *
 * Light of the map is interpolated between probes, and a disc of half a degree is met by few rays. As a sun of its own
 * (sun.h) its shadows are as sharp as they are. It is drawn into the map again at the end (sun_draw). Where photographs
 * saturate in it, which they do a little beyond its rim, it is as wide as the sun is, and how strong it is is left to
 * the joint fit (sun_clipped.h).
 *
 * Limits. One sun. Where the rim of an opening cuts the disc in every photograph its irradiance is not known from them,
 * and it stays in the map. */
#ifndef UNBAKE_LIGHT_SUN_SUN_SEEN_H
#define UNBAKE_LIGHT_SUN_SUN_SEEN_H

#include "server/gather/sun.h"

/* Fills *sun by the brightest disc of the map, and gives its pixels the radiance of what is around it. False, and both
 * unchanged, where it is no sun: not small, not seen as a whole, measured to be of little light, saturated below the
 * horizon (a glint), or in a map about which photographs disagree, which shows what is near. */
bool sun_seen_take(struct environment *environment, struct sun *sun);

#endif
