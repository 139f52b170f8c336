/* latlong.h -- the latitude-longitude layout of environment maps: direction of each pixel and its solid angle.
 * Everything that renders, measures, fills in or exports such a map uses this layout.
 *
 * The axis is y: row 0 is +y, the last row -y. A direction d has azimuth atan2(d.x, -d.z), from -z over +x, and polar
 * angle acos(d.y). The centre of column x is at azimuth 2 pi (x + 1/2) / width; row y is at polar angle pi y /
 * (height - 1), so the first and the last row are the poles. This is the layout of Mitsuba 3's `envmap`, against
 * which it is tested. Radiance is bilinear between pixel centres.
 *
 * Coordinates are continuous: the centre of pixel (x, y) is at (x, y). Heights are at least 2. */
#ifndef UNBAKE_SCENE_LATLONG_H
#define UNBAKE_SCENE_LATLONG_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>

#include "common/vec.h"

/* A direction as shares of its angles: azimuth over 2 pi, in [0, 1), and polar angle over pi, in [0, 1]. */
struct latlong {
    double around, down;
};

static inline struct latlong latlong_of(vec3 direction) {
    double around = atan2((double)direction.x, (double)-direction.z) / (2.0 * PI);
    around = around < 0.0 ? around + 1.0 : around;
    return (struct latlong){around < 1.0 ? around : 0.0, acos(fmin(fmax((double)direction.y, -1.0), 1.0)) / PI};
}

/* Unit direction. Polar angles beyond a pole continue on the other side. */
static inline vec3 latlong_direction(double around, double down) {
    double phi = 2.0 * PI * around, theta = PI * down, sine = sin(theta);
    return (vec3){(float)(sine * sin(phi)), (float)cos(theta), (float)(-sine * cos(phi))};
}

/* Azimuth of a column and polar angle of a row of a map, radians. */
static inline double latlong_azimuth(uint32_t width, double x) { return 2.0 * PI * (x + 0.5) / (double)width; }
static inline double latlong_polar(uint32_t height, double y) { return PI * y / (double)(height - 1); }

/* Unit direction of a place of a map. */
static inline vec3 latlong_pixel(uint32_t width, uint32_t height, double x, double y) {
    return latlong_direction((x + 0.5) / (double)width, y / (double)(height - 1));
}

/* Map coordinates of a unit direction: *x in [0, width), where width - 1/2 is between the last column and the first,
 * and
 * *y in [0, height - 1). Single precision: it is evaluated for every ray that leaves the room. */
static inline void latlong_place(uint32_t width, uint32_t height, vec3 d, float *x, float *y) {
    float turn = atan2f(d.x, -d.z) * (float)(0.5 / PI) - 0.5f / (float)width;
    turn -= floorf(turn);
    *x = fminf(turn * (float)width, (float)width * 0x1.fffffep-1f);
    float bottom = (float)(height - 1);
    *y = clampf(acosf(clampf(d.y, -1.0f, 1.0f)) * (float)(1.0 / PI) * bottom, 0.0f, bottom * 0x1.fffffep-1f);
}

/* The pixel whose centre is nearest in both angles, row * width + column. */
static inline size_t latlong_nearest(uint32_t width, uint32_t height, vec3 direction) {
    struct latlong at = latlong_of(direction);
    size_t column = (size_t)(at.around * (double)width), row = (size_t)(at.down * (double)(height - 1) + 0.5);
    return row * width + (column < width ? column : width - 1);
}

/* Solid angle of one pixel of a row, sr: the integral of its bilinear weight over the sphere; 4 pi over all pixels. */
static inline double latlong_pixel_angle(uint32_t width, uint32_t height, uint32_t row) {
    double step = PI / (double)(height - 1);
    double down = row == 0 || row + 1 == height ? 1.0 - sin(step) / step
                                                : 2.0 * (1.0 - cos(step)) / step * sin(latlong_polar(height, row));
    return 2.0 * PI / (double)width * down;
}

/* Solid angle of a cell between two columns of pixel centres and rows `row` and row + 1, sr. */
static inline double latlong_cell_angle(uint32_t width, uint32_t height, uint32_t row) {
    return 2.0 * PI / (double)width * (cos(latlong_polar(height, row)) - cos(latlong_polar(height, row + 1)));
}

#endif
