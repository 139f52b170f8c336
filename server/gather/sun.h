/* sun.h -- distant light from one small disc: the sun, where no photograph shows it (sun_find.h).
 *
 * Its shadows are sharp. While base colours are solved it is followed from every texel by rays of its own
 * instead of being interpolated between probes; after that it is a part of the environment's map. */
#ifndef UNBAKE_GATHER_SUN_H
#define UNBAKE_GATHER_SUN_H

#include <stdbool.h>

#include "server/capture/environment.h"
#include "server/gather/irradiance.h"
#include "server/render/accel.h"
#include "server/scene/surface.h"

struct sun {
    bool is_there;
    vec3 direction;   /* unit, towards its middle */
    float radius_rad; /* half the angle it fills */
    rgb irradiance;   /* of a surface that faces it */
};

/* Unit direction of a place in the disc, evenly for u in [0, 1)^2. */
vec3 sun_sample(const struct sun *sun, vec2 u);

/* Which part of the disc a point of the surface sees, by `rays` rays or, for 0, as many as it takes to tell lit,
 * unlit and half-lit places apart. 0 where either normal faces away from its middle. */
float sun_visibility(const struct sun *sun, const struct accel *accel, const struct surface_point *at, int rays);

/* Adds what it sends to the light that arrives at a point of the surface. */
void sun_add_light(const struct sun *sun, const struct accel *accel, const struct surface_point *at,
                   struct irradiance *irradiance);

/* Adds it to the map (latlong.h), which is made finer first if its pixels are larger than the disc: what the map sends
 * more comes to sun->irradiance, from around sun->direction. */
void sun_draw(const struct sun *sun, struct environment *environment);

#endif
