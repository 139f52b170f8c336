/* sky.h -- sun and sky by the model of Preetham, Shirley and Smits, A Practical Analytic Model for Daylight (1999), and
 * where the sun stands (Meeus, Astronomical Algorithms, 1998, chapter 25, low accuracy: .01 degrees; without
 * refraction). */
#ifndef UNBAKE_RELIGHT_SKY_H
#define UNBAKE_RELIGHT_SKY_H

#include <stdbool.h>

#include "common/image.h"
#include "common/vec.h"
#include "server/relight/compass.h"

struct sun_position {
    double elevation; /* radians above the horizon */
    double azimuth;   /* radians from north over east */
};

/* At a time in hours after 0:00 UTC of a day of the Gregorian calendar (it may be negative or beyond 24). */
struct sun_position sky_sun(int year, int month, int day, double hours_utc, double latitude_deg, double longitude_deg);

/* When the sun rises and sets on that day, hours after 0:00 UTC: around the day's solar noon. False where it does not
 * rise. */
bool sky_day(int year, int month, int day, double latitude_deg, double longitude_deg, double *rise, double *set);

struct sky {
    struct sun_position sun;
    double turbidity;
    double north; /* radians clockwise from above, from the compass's north */
};

/* Luminance (cd/m2) as linear Rec. 709 of the sky in a direction at zenith angle `theta` and angle `gamma` from the
 * sun, both radians; theta below pi / 2. The sun is above the horizon. */
rgb sky_radiance(const struct sky *sky, double theta, double gamma);
/* Of the sun's disc, after the atmosphere. */
rgb sky_sun_radiance(const struct sky *sky);
/* CIE x, y and luminance (cd/m2) of the zenith. */
void sky_zenith(const struct sky *sky, double *x, double *y, double *luminance);

#define SKY_SUN_ANGLE 6.7443e-5 /* solid angle of the sun's disc, sr (the paper's) */

/* The map of distant light in the room's frame, cd/m2: sky, sun, and below the horizon a grey ground lit by both. Black
 * when the sun is below the horizon. A part is what is left without the other: light of the sky alone (and the ground
 * that it lights), or of the sun; their sum is the whole. *map is the caller's. */
enum distant_part { DISTANT_WHOLE, DISTANT_SKY, DISTANT_SUN };
void sky_map(const struct sky *sky, const struct compass *compass, enum distant_part part, struct image *map);

#endif
