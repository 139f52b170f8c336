/* compass.h -- which way is up in a room, and from where azimuth is counted. */
#ifndef UNBAKE_RELIGHT_COMPASS_H
#define UNBAKE_RELIGHT_COMPASS_H

#include "common/vec.h"

/* Unit vectors of the room's frame, a right-handed (east, up, -north). */
struct compass {
    vec3 up, north, east;
};

/* For one of the room's axes, of either sign: north is -z where y is up, y where z is up and -z where x is up. */
struct compass compass_of(vec3 up);

/* A direction of the room in the frame of a latitude-longitude map (latlong.h), whose top is y and whose azimuth 0 is
 * north; and back. */
static inline vec3 compass_to_map(const struct compass *c, vec3 d) {
    return vec3_make(vec3_dot(c->east, d), vec3_dot(c->up, d), -vec3_dot(c->north, d));
}
static inline vec3 compass_from_map(const struct compass *c, vec3 d) {
    return vec3_mad(vec3_mad(vec3_scale(c->east, d.x), d.y, c->up), -d.z, c->north);
}

#endif
