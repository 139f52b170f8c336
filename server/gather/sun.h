/* sun.h -- the sun: distant light from one small disc, that photographs show (sun_seen.h) or not (sun_find.h).
 *
 * Its shadows are sharp. While base colours are solved, every texel traces shadow rays to it, instead of interpolating
 * between probes; afterwards it becomes a part of the environment map. */
#ifndef UNBAKE_GATHER_SUN_H
#define UNBAKE_GATHER_SUN_H

#include <stdbool.h>

#include "server/capture/distant/environment.h"
#include "server/gather/irradiance.h"
#include "server/render/accel.h"
#include "server/scene/surface.h"

/* Radians: half the angle under which the sun appears, .27 degrees. */
#define SUN_RADIUS_RAD 0.0047f

struct sun {
    bool is_there;
    bool is_measured; /* photographs show it, and how bright it is */
    bool is_clipped;  /* photographs saturate in it, or in its light: how bright it is comes from the joint fit */
    vec3 direction;   /* unit, towards its middle */
    float radius_rad; /* angular radius */
    rgb irradiance;   /* of a surface that faces it */
    rgb least;        /* the same, as far as saturated photographs tell it */
};

/* Unit direction uniformly distributed over the disc, for u in [0, 1)^2. */
vec3 sun_sample(const struct sun *sun, vec2 u);

/* Visible fraction of the disc at a surface point, by `rays` shadow rays or, for 0, adaptively: more in penumbrae. 0
 * where the shading or geometric normal faces away from its middle. */
float sun_visibility(const struct sun *sun, const struct accel *accel, const struct surface_point *at, int rays);

/* Adds its light to the irradiance at a surface point. */
void sun_add_light(const struct sun *sun, const struct accel *accel, const struct surface_point *at,
                   struct irradiance *irradiance);

/* Adds it to the environment map (latlong.h), which is refined first if its pixels are larger than the disc. The added
 * irradiance is sun->irradiance, around sun->direction. */
void sun_draw(const struct sun *sun, struct environment *environment);

#endif
