/* test_geodesy.c -- UTM against PROJ's figures, and the affine matrices that hold in a room. */
#include "server/ingest/source/geodesy.h"

#include <string.h>

#include "server/scene/coordinates.h"
#include "tests/check.h"

#define DEGREE (3.14159265358979323846 / 180.0)

/* Geocentric coordinates by their definition. */
static void make_place(double latitude, double longitude, double height_m, double place[3]) {
    double phi = latitude * DEGREE, l = longitude * DEGREE, e2 = 0.00669437999014132;
    double normal = 6378137.0 / sqrt(1.0 - e2 * sin(phi) * sin(phi));
    place[0] = (normal + height_m) * cos(phi) * cos(l);
    place[1] = (normal + height_m) * cos(phi) * sin(l);
    place[2] = (normal * (1.0 - e2) + height_m) * sin(phi);
}

static void apply(double m[3][4], const double at[3], double out[3]) {
    for (int i = 0; i < 3; i++)
        out[i] = m[i][0] * at[0] + m[i][1] * at[1] + m[i][2] * at[2] + m[i][3];
}

/* As PROJ has it (echo 12 55 | proj +proj=utm +zone=32), and by Redfearn's formulas. */
static const struct {
    double latitude, longitude;
    int epsg;
    double easting, northing;
} rows[] = {
    {55.0, 12.0, 32632, 691875.6321, 6098907.8250},
    {50.0, 15.0, 32633, 500000.0, 5538630.7027},
    {-33.0, 151.0, 32756, 313152.7772, 6346936.4957},
};

static void test_points(void) {
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct utm utm;
        double place[3], out[3];
        make_place(rows[i].latitude, rows[i].longitude, 123.0, place);
        CHECK(geodesy_utm_of_epsg(rows[i].epsg, &utm));
        const struct utm own = geodesy_utm_at(place);
        CHECK(own.is_south == utm.is_south && own.zone == (i == 0 ? 33 : utm.zone)); /* 12 degrees: the zones' border */
        geodesy_to_utm(place, &utm, out);
        CHECK_NEAR(out[0], rows[i].easting, 2e-3);
        CHECK_NEAR(out[1], rows[i].northing, 2e-3);
        CHECK_NEAR(out[2], 123.0, 1e-6);
    }
    struct utm utm;
    CHECK(!geodesy_utm_of_epsg(4326, &utm) && !geodesy_utm_of_epsg(32661, &utm) && !geodesy_utm_of_epsg(32600, &utm));
    CHECK(geodesy_utm_of_epsg(25832, &utm) && utm.zone == 32 && !utm.is_south);
}

/* Ten metres from the place, across the zone and on both sides of the equator. */
static void test_room(void) {
    static const double offsets[4][3] = {{10, 0, 0}, {0, 10, 0}, {0, 0, 3}, {-7, 7, 2}};
    for (int side = -1; side <= 1; side += 2)
        for (double longitude = 12.5; longitude < 18.0; longitude += 2.5) {
            double place[3], local[3][4], from_utm[3][4];
            make_place(side * 48.0, longitude, 300.0, place);
            const struct utm utm = geodesy_utm_at(place);
            geodesy_from_local(place, local);
            geodesy_from_utm(place, &utm, from_utm);
            for (size_t i = 0; i < sizeof offsets / sizeof *offsets; i++) {
                double there[3], projected[3], back[3];
                apply(local, offsets[i], there);
                geodesy_to_utm(there, &utm, projected);
                apply(from_utm, projected, back);
                for (int k = 0; k < 3; k++) /* heights are scaled like lengths: .0004 of 3 m */
                    CHECK_NEAR(back[k], there[k], 2e-3);
            }
        }
}

int main(void) {
    test_points();
    test_room();
    return check_result();
}
