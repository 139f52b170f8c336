/* sky.c -- see sky.h. Equations and tables are those of the paper's appendices; sky_sun is Meeus's. */
#include "server/relight/sky.h"

#include <math.h>
#include <string.h>

#include "server/scene/latlong.h"

#define RADIANS (PI / 180.0)
#define MAP_WIDTH 1024                        /* pixels of .35 degrees; the sun is .53 degrees wide */
#define MAP_HEIGHT 513                        /* rows, the poles among them */
#define SUN_RADIUS (sqrt(SKY_SUN_ANGLE / PI)) /* radians */
#define GROUND_ALBEDO 0.2                     /* of mixed ground, without snow */
#define MIN_COSINE 0.01                       /* keeps the sky next to the horizon finite */

/* --- where the sun stands --------------------------------------------------------------------------------------- */

/* Days from 2000-01-01 12:00 UTC (Meeus, equation 7.1). */
static double days_since_2000(int year, int month, int day, double hours) {
    if (month <= 2) {
        year--;
        month += 12;
    }
    int century = year / 100;
    double julian =
        floor(365.25 * (year + 4716)) + floor(30.6001 * (month + 1)) + day + 2 - century + century / 4 - 1524.5;
    return julian - 2451545.0 + hours / 24.0;
}

#define TERRESTRIAL_DELAY 69.0 /* seconds of terrestrial time before UTC, in the 2020s */

struct sun_position sky_sun(int year, int month, int day, double hours_utc, double latitude_deg, double longitude_deg) {
    double d = days_since_2000(year, month, day, hours_utc), t = (d + TERRESTRIAL_DELAY / 86400.0) / 36525.0;
    double mean_longitude = 280.46646 + t * (36000.76983 + t * 0.0003032);
    double anomaly = (357.52911 + t * (35999.05029 - t * 0.0001537)) * RADIANS;
    double centre = (1.914602 - t * (0.004817 + t * 0.000014)) * sin(anomaly) +
                    (0.019993 - t * 0.000101) * sin(2.0 * anomaly) + 0.000289 * sin(3.0 * anomaly);
    double node = (125.04 - 1934.136 * t) * RADIANS;
    double longitude = (mean_longitude + centre - 0.00569 - 0.00478 * sin(node)) * RADIANS; /* apparent */
    double tilt = (23.4392911 - t * 0.0130042 + 0.00256 * cos(node)) * RADIANS;
    double ascension = atan2(cos(tilt) * sin(longitude), cos(longitude)),
           declination = asin(sin(tilt) * sin(longitude));
    double sidereal = (280.46061837 + 360.98564736629 * d - 0.00478 * sin(node) * cos(tilt)) * RADIANS;
    double hour = sidereal + longitude_deg * RADIANS - ascension, latitude = latitude_deg * RADIANS;
    double up = sin(latitude) * sin(declination) + cos(latitude) * cos(declination) * cos(hour);
    double east = -cos(declination) * sin(hour);
    double north = cos(latitude) * sin(declination) - sin(latitude) * cos(declination) * cos(hour);
    double azimuth = atan2(east, north);
    return (struct sun_position){asin(fmin(fmax(up, -1.0), 1.0)), azimuth < 0.0 ? azimuth + 2.0 * PI : azimuth};
}

bool sky_day(int year, int month, int day, double latitude_deg, double longitude_deg, double *rise, double *set) {
    const double step = 1.0 / 60.0; /* hours; two thousandths of the span from rise to set */
    double noon = 12.0 - longitude_deg / 15.0;
    /* The equation of time moves noon by a quarter of an hour at most. */
    double best = noon, highest = -PI;
    for (double at = noon - 0.5; at <= noon + 0.5; at += step) {
        double elevation = sky_sun(year, month, day, at, latitude_deg, longitude_deg).elevation;
        if (elevation > highest) {
            highest = elevation;
            best = at;
        }
    }
    if (!(highest > 0.0))
        return false;
    for (*rise = best; best - *rise < 12.0; *rise -= step)
        if (!(sky_sun(year, month, day, *rise - step, latitude_deg, longitude_deg).elevation > 0.0))
            break;
    for (*set = best; *set - best < 12.0; *set += step)
        if (!(sky_sun(year, month, day, *set + step, latitude_deg, longitude_deg).elevation > 0.0))
            break;
    return true;
}

/* --- the sky: appendix A.2 -------------------------------------------------------------------------------------- */

/* Perez' five coefficients for luminance and for chromaticity x and y: slope by turbidity, and value at 0. */
static const double perez_by_turbidity[3][5][2] = {
    {{0.1787, -1.4630}, {-0.3554, 0.4275}, {-0.0227, 5.3251}, {0.1206, -2.5771}, {-0.0670, 0.3703}},
    {{-0.0193, -0.2592}, {-0.0665, 0.0008}, {-0.0004, 0.2125}, {-0.0641, -0.8989}, {-0.0033, 0.0452}},
    {{-0.0167, -0.2608}, {-0.0950, 0.0092}, {-0.0079, 0.2102}, {-0.0441, -1.6537}, {-0.0109, 0.0529}},
};

/* Of the zenith's chromaticity: rows by the power of turbidity from 2 to 0, columns by that of the sun's zenith angle
 * from 3 to 0. */
static const double zenith_of_x[3][4] = {
    {0.00166, -0.00375, 0.00209, 0.0}, {-0.02903, 0.06377, -0.03202, 0.00394}, {0.11693, -0.21196, 0.06052, 0.25886}};
static const double zenith_of_y[3][4] = {
    {0.00275, -0.00610, 0.00317, 0.0}, {-0.04214, 0.08970, -0.04153, 0.00516}, {0.15346, -0.26756, 0.06670, 0.26688}};

static double polynomial(const double table[3][4], double turbidity, double angle) {
    double sum = 0.0;
    for (int row = 0; row < 3; row++) {
        const double *k = table[row];
        sum = sum * turbidity + ((k[0] * angle + k[1]) * angle + k[2]) * angle + k[3];
    }
    return sum;
}

static double sun_zenith(const struct sky *sky) { return 0.5 * PI - sky->sun.elevation; }

void sky_zenith(const struct sky *sky, double *x, double *y, double *luminance) {
    double t = sky->turbidity, angle = sun_zenith(sky), chi = (4.0 / 9.0 - t / 120.0) * (PI - 2.0 * angle);
    *x = polynomial(zenith_of_x, t, angle);
    *y = polynomial(zenith_of_y, t, angle);
    *luminance = 1000.0 * fmax(0.0, (4.0453 * t - 4.9710) * tan(chi) - 0.2155 * t + 2.4192);
}

/* Perez' distribution, equation 3. */
static double perez(const double k[5][2], double turbidity, double theta, double gamma) {
    double v[5], cosine = fmax(cos(theta), MIN_COSINE);
    for (int i = 0; i < 5; i++)
        v[i] = k[i][0] * turbidity + k[i][1];
    return (1.0 + v[0] * exp(v[1] / cosine)) * (1.0 + v[2] * exp(v[3] * gamma) + v[4] * cos(gamma) * cos(gamma));
}

/* To Rec. 709's primaries; IEC 61966-2-1. */
static rgb from_xyz(double x, double y, double z) {
    return rgb_make((float)fmax(0.0, 3.2404542 * x - 1.5371385 * y - 0.4985314 * z),
                    (float)fmax(0.0, -0.9692660 * x + 1.8760108 * y + 0.0415560 * z),
                    (float)fmax(0.0, 0.0556434 * x - 0.2040259 * y + 1.0572252 * z));
}

rgb sky_radiance(const struct sky *sky, double theta, double gamma) {
    double value[3];
    sky_zenith(sky, &value[1], &value[2], &value[0]);
    for (int i = 0; i < 3; i++)
        value[i] *= perez(perez_by_turbidity[i], sky->turbidity, theta, gamma) /
                    perez(perez_by_turbidity[i], sky->turbidity, 0.0, sun_zenith(sky));
    double y = fmax(value[2], 1e-3), luminance = fmax(value[0], 0.0);
    return from_xyz(value[1] / y * luminance, luminance, (1.0 - value[1] - y) / y * luminance);
}

/* --- the sun: appendix A.1 -------------------------------------------------------------------------------------- */

#define SPECTRUM_FIRST 380 /* nm */
#define SPECTRUM_STEP 10   /* nm */
#define SPECTRUM_COUNT 38  /* to 750 nm */
/* Of the sun above the atmosphere, 100 W / (m2 sr nm). */
static const double sun_radiance[SPECTRUM_COUNT] = {
    165.5, 162.3, 211.2, 258.8, 258.2, 242.3, 267.6, 296.6, 305.4, 300.6, 306.6, 288.3, 287.1,
    278.2, 271.0, 272.3, 263.6, 255.0, 250.6, 253.1, 253.5, 251.3, 246.3, 241.7, 236.8, 232.1,
    228.2, 223.4, 219.7, 215.3, 211.0, 207.3, 202.4, 198.7, 194.3, 190.7, 186.3, 182.6};
/* Of ozone, 1 / cm; of water vapour, and of the mixed gases, which absorb at 760 nm (Iqbal 1983). */
static const double ozone[SPECTRUM_COUNT] = {0.0,   0.0,   0.0,   0.0,   0.0,   0.0,   0.0,   0.003, 0.006, 0.009,
                                             0.014, 0.021, 0.030, 0.040, 0.048, 0.063, 0.075, 0.085, 0.103, 0.120,
                                             0.120, 0.115, 0.125, 0.120, 0.105, 0.090, 0.079, 0.067, 0.057, 0.048,
                                             0.036, 0.028, 0.023, 0.018, 0.014, 0.011, 0.010, 0.009};
static const double vapour[SPECTRUM_COUNT] = {
    [31] = 0.016, [32] = 0.024, [33] = 0.0125, [34] = 1.0, [35] = 0.87, [36] = 0.061, [37] = 0.001};
#define OZONE_CM 0.35        /* column of ozone at standard pressure and temperature (A.1) */
#define VAPOUR_CM 2.0        /* of precipitable water (A.1) */
#define AEROSOL_EXPONENT 1.3 /* Angstrom's, of the aerosols' sizes (A.1) */

/* The CIE 1931 observer, fitted by sums of lobes (Wyman, Sloan and Shirley 2013, listing 1). */
static double lobe(double wavelength, double scale, double middle, double before, double after) {
    double t = (wavelength - middle) * (wavelength < middle ? before : after);
    return scale * exp(-0.5 * t * t);
}

static void observer(double w, double xyz[3]) {
    xyz[0] = lobe(w, 0.362, 442.0, 0.0624, 0.0374) + lobe(w, 1.056, 599.8, 0.0264, 0.0323) +
             lobe(w, -0.065, 501.1, 0.0490, 0.0382);
    xyz[1] = lobe(w, 0.821, 568.8, 0.0213, 0.0247) + lobe(w, 0.286, 530.9, 0.0613, 0.0322);
    xyz[2] = lobe(w, 1.217, 437.0, 0.0845, 0.0278) + lobe(w, 0.681, 459.0, 0.0385, 0.0725);
}

/* The share of light that arrives through a relative optical mass. */
static double transmittance(int i, double mass, double turbidity) {
    double micrometres = (SPECTRUM_FIRST + SPECTRUM_STEP * i) * 1e-3;
    double beta = 0.04608 * turbidity - 0.04586, water = vapour[i] * VAPOUR_CM * mass;
    double depth =
        mass * (0.008735 * pow(micrometres, -4.08) + beta * pow(micrometres, -AEROSOL_EXPONENT) + ozone[i] * OZONE_CM) +
        0.2385 * water / pow(1.0 + 20.07 * water, 0.45);
    return exp(-depth);
}

#define LUMENS_PER_WATT 683.0 /* at 555 nm: the definition of the candela */

rgb sky_sun_radiance(const struct sky *sky) {
    double elevation = fmax(sky->sun.elevation, 0.0), xyz[3] = {0.0, 0.0, 0.0};
    double mass = 1.0 / (sin(elevation) + 0.15 * pow(elevation / RADIANS + 3.885, -1.253));
    for (int i = 0; i < SPECTRUM_COUNT; i++) {
        double seen[3], power = 100.0 * sun_radiance[i] * transmittance(i, mass, sky->turbidity) * SPECTRUM_STEP;
        observer(SPECTRUM_FIRST + SPECTRUM_STEP * i, seen);
        for (int c = 0; c < 3; c++)
            xyz[c] += LUMENS_PER_WATT * power * seen[c];
    }
    return from_xyz(xyz[0], xyz[1], xyz[2]);
}

/* --- the map ---------------------------------------------------------------------------------------------------- */

/* Towards the sun, in the map's frame. */
static vec3 towards_sun(const struct sky *sky) {
    return latlong_direction((sky->sun.azimuth + sky->north) / (2.0 * PI), (0.5 * PI - sky->sun.elevation) / PI);
}

static double angle_between(vec3 a, vec3 b) { return acos(fmin(fmax((double)vec3_dot(a, b), -1.0), 1.0)); }

static void add_pixel(struct image *map, uint32_t x, uint32_t y, rgb amount) {
    float *p = map->pixel + 3 * ((size_t)y * map->width + x);
    p[0] += amount.r;
    p[1] += amount.g;
    p[2] += amount.b;
}

/* Spreads the sun over the pixels of its disc, by how much of each it covers; their sum is its whole light. */
static void add_sun(const struct sky *sky, vec3 sun, const struct compass *compass, struct image *map) {
    enum { RINGS = 8, SPOKES = 24 };
    vec3 s, t;
    vec3_frame(sun, &s, &t);
    rgb part = rgb_scale(sky_sun_radiance(sky), (float)(SKY_SUN_ANGLE / (RINGS * SPOKES)));
    for (int k = 0; k < RINGS * SPOKES; k++) {
        double radius = SUN_RADIUS * sqrt((k / SPOKES + 0.5) / (double)RINGS),
               around = 2.0 * PI * (k % SPOKES + 0.5) / (double)SPOKES;
        vec3 d = vec3_mad(vec3_mad(sun, (float)(radius * cos(around)), s), (float)(radius * sin(around)), t);
        float x, y;
        latlong_place(map->width, map->height, compass_from_map(compass, vec3_normalize(d)), &x, &y);
        for (uint32_t i = 0; i < 4; i++) {
            uint32_t column = ((uint32_t)x + i % 2) % map->width, row = (uint32_t)y + i / 2;
            float across = x - floorf(x), down = y - floorf(y);
            float weight = (i % 2 ? across : 1.0f - across) * (i / 2 ? down : 1.0f - down);
            double angle = latlong_pixel_angle(map->width, map->height, row);
            add_pixel(map, column, row, rgb_scale(part, weight / (float)angle));
        }
    }
}

/* Illuminance of level ground by the map. */
static rgb on_ground(const struct compass *compass, const struct image *map) {
    double sum[3] = {0.0, 0.0, 0.0};
    for (uint32_t y = 0; y < map->height; y++) {
        double angle = latlong_pixel_angle(map->width, map->height, y);
        for (uint32_t x = 0; x < map->width; x++) {
            double cosine = (double)vec3_dot(compass->up, latlong_pixel(map->width, map->height, x, y));
            const float *p = map->pixel + 3 * ((size_t)y * map->width + x);
            for (int c = 0; c < 3 && cosine > 0.0; c++)
                sum[c] += angle * cosine * (double)p[c];
        }
    }
    return rgb_make((float)sum[0], (float)sum[1], (float)sum[2]);
}

void sky_map(const struct sky *sky, const struct compass *compass, enum distant_part part, struct image *map) {
    image_init_rgb(map, MAP_WIDTH, MAP_HEIGHT);
    if (!(sky->sun.elevation > 0.0))
        return;
    vec3 sun = towards_sun(sky);
    for (uint32_t y = 0; y < map->height && part != DISTANT_SUN; y++) {
        for (uint32_t x = 0; x < map->width; x++) {
            vec3 d = compass_to_map(compass, latlong_pixel(map->width, map->height, x, y));
            if (d.y > 0.0f)
                add_pixel(map, x, y, sky_radiance(sky, acos((double)d.y), angle_between(d, sun)));
        }
    }
    if (part != DISTANT_SKY)
        add_sun(sky, sun, compass, map);
    rgb ground = rgb_scale(on_ground(compass, map), (float)(GROUND_ALBEDO / PI));
    for (uint32_t y = 0; y < map->height; y++)
        for (uint32_t x = 0; x < map->width; x++)
            if (!(vec3_dot(compass->up, latlong_pixel(map->width, map->height, x, y)) > 0.0f))
                add_pixel(map, x, y, ground);
}
