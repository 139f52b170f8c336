/* sun_refit.h -- how strong a sun is that no photograph shows, once the gloss of what it lights is known.
 *
 * sun_find.h compares what the sun lights with the rest of its segment, before anything is known of gloss. A polished
 * floor mirrors walls and windows; that makes its shade look lighter, and bluer, than its wood is, and the sun that
 * lights the rest of it weaker and yellower than it is. Whether there is a sun, where and how wide, stays as it was
 * found. A sun in whose light photographs saturate is not changed: the joint fit finds its strength anew. */
#ifndef UNBAKE_LIGHT_SUN_SUN_REFIT_H
#define UNBAKE_LIGHT_SUN_SUN_REFIT_H

#include "server/material/divide.h"

/* Gives the sun, if it is there, the irradiance by which base colours are most alike, highlights taken off, within a
 * factor of what it has; d->sun is the same. Measures some texels (divide.h). The same for any number of threads. */
void sun_refit(struct divide *d, struct sun *sun);

#endif
