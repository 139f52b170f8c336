/* bounced_light.h -- light of a segment that reaches points by way of surfaces that no photograph shows.
 *
 * What photographs show has its reflections in it already. A lamp behind a mirror or in a cove lights the room mostly
 * by way of the surfaces around it, which none shows. Particles from the segment are followed while they meet such
 * surfaces; each place where one is reflected lights the points as a disc (instant radiosity, Keller 1997). */
#ifndef UNBAKE_LIGHT_BOUNCED_LIGHT_H
#define UNBAKE_LIGHT_BOUNCED_LIGHT_H

#include "server/light/segment_light.h"

/* Discs that stand for all reflections, by unseen surfaces, of a radiance of 1 from the front of a segment;
 * BOUNCED_MAX at most, their number is the result. albedo[segment_count]: of unseen surfaces, lamps among them. */
#define BOUNCED_MAX 1024
size_t bounced_light_find(const struct segment_light *light, uint32_t segment, const float *albedo,
                          struct segment_light_disc disc[BOUNCED_MAX]);

#endif
