/* geodesy.h -- coordinates on the Earth (WGS 84): geocentric ones, local ones, and UTM. Radians and metres.
 *
 * In a room a map projection is a rotation and a scale to less than a millimetre, so that coordinates are related by
 * affine matrices that hold at a place. */
#ifndef UNBAKE_INGEST_SOURCE_GEODESY_H
#define UNBAKE_INGEST_SOURCE_GEODESY_H

#include <stdbool.h>

struct utm {
    int zone; /* 1 to 60 */
    bool is_south;
};

/* Of a code of EPSG's: WGS 84 (326zz, 327zz) and ETRS89 (258zz), which differ by less than a metre of all at once.
 * False: none of UTM. */
bool geodesy_utm_of_epsg(int code, struct utm *utm);
/* That of a geocentric place. */
struct utm geodesy_utm_at(const double place[3]);

/* To geocentric coordinates from local ones: x east, y north, z up, with the origin at `place`. */
void geodesy_from_local(const double place[3], double geocentric_from_local[3][4]);
/* To geocentric coordinates from easting, northing and height above the ellipsoid: what holds at `place`. */
void geodesy_from_utm(const double place[3], const struct utm *utm, double geocentric_from_utm[3][4]);

/* Easting, northing and height of a place: Krueger's series to the third power of the flattening, better than a
 * millimetre within the zone (Karney 2011, "Transverse Mercator with an accuracy of a few nanometers"). */
void geodesy_to_utm(const double place[3], const struct utm *utm, double out[3]);

#endif
