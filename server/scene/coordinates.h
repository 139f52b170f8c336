/* coordinates.h -- coordinate systems that a capture's files know besides that of its poses. The mesh may be in one of
 * them. */
#ifndef UNBAKE_SCENE_COORDINATES_H
#define UNBAKE_SCENE_COORDINATES_H

#include <stdbool.h>

#define COORDINATES_MAX 4 /* that a capture's files know, besides those of its poses */

struct coordinates {
    const char *name;        /* as a reading says it: "capture"; static */
    const char *text;        /* "those of the capture"; static */
    double poses_from[3][4]; /* to those of the poses: rotation times scale, and translation */
};

/* inverse = m^-1 for the affine m; returns the determinant of its linear part. */
double coordinates_invert(const double m[3][4], double inverse[3][4]);
/* Rotation matrix of the unit quaternion w x y z. */
void coordinates_rotation(const double q[4], double r[3][3]);
/* out = a b, first b. */
void coordinates_product(const double a[3][4], const double b[3][4], double out[3][4]);

#endif
