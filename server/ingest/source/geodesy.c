/* geodesy.c -- see geodesy.h. */
#include "server/ingest/source/geodesy.h"

#include <math.h>

#include "common/vec.h"
#include "server/scene/coordinates.h"

#define EQUATOR_M 6378137.0 /* WGS 84 */
#define FLATTENING (1.0 / 298.257223563)
#define ECCENTRICITY2 (FLATTENING * (2.0 - FLATTENING)) /* squared */
#define UTM_SCALE 0.9996                                /* on the central meridian */
#define UTM_EASTING_M 500000.0                          /* of the central meridian */
#define UTM_SOUTH_M 10000000.0                          /* northing of the equator in the south */
#define STEP_M 100.0                                    /* over which convergence and scale are measured */

/* Latitude, longitude and height: the iteration converges to less than a nanometre in six steps on the ground. */
static void to_geodetic(const double at[3], double *latitude, double *longitude, double *height_m) {
    double across = hypot(at[0], at[1]), phi = atan2(at[2], across * (1.0 - ECCENTRICITY2)), normal = EQUATOR_M;
    for (int i = 0; i < 6; i++) {
        normal = EQUATOR_M / sqrt(1.0 - ECCENTRICITY2 * sin(phi) * sin(phi));
        phi = atan2(at[2] + ECCENTRICITY2 * normal * sin(phi), across);
    }
    *latitude = phi;
    *longitude = atan2(at[1], at[0]);
    *height_m = across * cos(phi) + at[2] * sin(phi) - EQUATOR_M * EQUATOR_M / normal;
}

bool geodesy_utm_of_epsg(int code, struct utm *utm) {
    int zone = code % 100, system = code / 100;
    bool is_one = (system == 326 || system == 327 || system == 258) && zone >= 1 && zone <= 60;
    if (is_one)
        *utm = (struct utm){zone, system == 327};
    return is_one;
}

struct utm geodesy_utm_at(const double place[3]) {
    double latitude, longitude, height_m;
    to_geodetic(place, &latitude, &longitude, &height_m);
    int zone = (int)floor((longitude * 180.0 / PI + 180.0) / 6.0) + 1;
    return (struct utm){zone > 60 ? 60 : zone, latitude < 0.0};
}

void geodesy_from_local(const double place[3], double m[3][4]) {
    double latitude, longitude, height_m;
    to_geodetic(place, &latitude, &longitude, &height_m);
    double sin_phi = sin(latitude), cos_phi = cos(latitude), sin_l = sin(longitude), cos_l = cos(longitude);
    const double axes[3][3] = {{-sin_l, -sin_phi * cos_l, cos_phi * cos_l},
                               {cos_l, -sin_phi * sin_l, cos_phi * sin_l},
                               {0.0, cos_phi, sin_phi}};
    for (int i = 0; i < 12; i++)
        m[i / 4][i % 4] = i % 4 < 3 ? axes[i / 4][i % 4] : place[i / 4];
}

void geodesy_to_utm(const double place[3], const struct utm *utm, double out[3]) {
    const double n = FLATTENING / (2.0 - FLATTENING), n2 = n * n, n3 = n2 * n;
    const double radius = UTM_SCALE * EQUATOR_M / (1.0 + n) * (1.0 + n2 / 4.0 + n2 * n2 / 64.0);
    const double alpha[3] = {n / 2.0 - 2.0 * n2 / 3.0 + 5.0 * n3 / 16.0, 13.0 * n2 / 48.0 - 3.0 * n3 / 5.0,
                             61.0 * n3 / 240.0};
    double phi, lambda, e = sqrt(ECCENTRICITY2);
    to_geodetic(place, &phi, &lambda, &out[2]);
    lambda -= (6.0 * utm->zone - 183.0) * PI / 180.0;
    double t = sinh(atanh(sin(phi)) - e * atanh(e * sin(phi)));
    double xi = atan2(t, cos(lambda)), eta = asinh(sin(lambda) / hypot(t, cos(lambda)));
    double north = xi, east = eta;
    for (int j = 1; j <= 3; j++) {
        north += alpha[j - 1] * sin(2.0 * j * xi) * cosh(2.0 * j * eta);
        east += alpha[j - 1] * cos(2.0 * j * xi) * sinh(2.0 * j * eta);
    }
    out[0] = UTM_EASTING_M + radius * east;
    out[1] = (utm->is_south ? UTM_SOUTH_M : 0.0) + radius * north;
}

void geodesy_from_utm(const double place[3], const struct utm *utm, double m[3][4]) {
    double local[3][4], at[3], end[2][3], utm_from_local[3][4] = {{0}}, inverse[3][4];
    geodesy_from_local(place, local);
    geodesy_to_utm(place, utm, at);
    for (int side = 0; side < 2; side++) {
        double east[3];
        for (int i = 0; i < 3; i++)
            east[i] = place[i] + (side == 0 ? -STEP_M : STEP_M) * local[i][0];
        geodesy_to_utm(east, utm, end[side]);
    }
    /* Of a conformal map the direction of north follows from that of east. Heights get its scale, too (.9996 to 1.001),
     * so that lengths stay in proportion. */
    double x = (end[1][0] - end[0][0]) / (2.0 * STEP_M), y = (end[1][1] - end[0][1]) / (2.0 * STEP_M);
    utm_from_local[0][0] = utm_from_local[1][1] = x;
    utm_from_local[1][0] = y;
    utm_from_local[0][1] = -y;
    utm_from_local[2][2] = hypot(x, y);
    for (int i = 0; i < 3; i++)
        utm_from_local[i][3] = at[i];
    coordinates_invert((const double(*)[4])utm_from_local, inverse);
    coordinates_product((const double(*)[4])local, (const double(*)[4])inverse, m);
}
