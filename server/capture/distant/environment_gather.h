/* environment_gather.h -- makes the map of distant light (environment.h) from all photographs that look out of the
 * room. */
#ifndef UNBAKE_CAPTURE_DISTANT_ENVIRONMENT_GATHER_H
#define UNBAKE_CAPTURE_DISTANT_ENVIRONMENT_GATHER_H

#include "server/capture/distant/environment.h"
#include "server/capture/views.h"

/* The map has about the angular resolution of the photographs: its width is the largest power of two up to 2 pi x the
 * median focal length in pixels, within the limits of environment.h. Exposures must be known. edge_m: how far the
 * mesh's edges may be off; 0: not at all. *e is to be released in any case. False when no photograph has open pixels.
 * The same for any number of threads. */
bool environment_gather(struct environment *e, const struct views *views, float edge_m, struct parallel *pool);

#endif
