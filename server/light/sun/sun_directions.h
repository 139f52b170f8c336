/* sun_directions.h -- directions in which a sun may stand, and the way from a likely one to a likelier. */
#ifndef UNBAKE_LIGHT_SUN_SUN_DIRECTIONS_H
#define UNBAKE_LIGHT_SUN_SUN_DIRECTIONS_H

#include <stddef.h>

#include "server/capture/distant/environment.h"

struct sun_candidate {
    vec3 direction; /* unit, towards it */
    double score;   /* the greater the likelier; 0 at first */
};

/* Directions 3 degrees apart, all over the sphere, but for those that an environment with a map knows (is_known; NULL:
 * none); returns their number. *candidate is the caller's. */
size_t sun_directions_spread(const struct environment *environment,
                             bool (*is_known)(const struct environment *environment, vec3 direction),
                             struct sun_candidate **candidate);

/* The likeliest first. */
void sun_directions_sort(struct sun_candidate *candidate, size_t count);

/* Moves a candidate by steps of so many degrees, and ever smaller ones down to `least_degrees`, for as long as its
 * score rises. */
void sun_directions_walk(struct sun_candidate *candidate, double degrees, double least_degrees,
                         double (*score_of)(void *user, vec3 direction), void *user);

#endif
