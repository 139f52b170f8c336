/* coverage.c -- see coverage.h.
 *
 * A convex shape meets the square [x0, x1] x [y0, y1] exactly when the part of it within the
 * strip y0 <= y <= y1 has an x in [x0, x1]. So a row's covered columns are an interval, given by
 * the ends of the triangle's edges clipped to the row's strip.
 *
 * Double precision decides exactly: the crossing of an edge and a strip's border is a fraction
 * n / d with |n| < 2^48, |d| < 2^24, thus a multiple of 1 / d, and is compared with integers
 * only. A fraction that is no integer is 2^-24 or more away from one, its rounding error is
 * below 2^-28. */
#include "server/scene/coverage.h"

#include <math.h>

#define MARGIN 1 /* unit */

static int32_t min3(const int32_t v[3]) {
    int32_t m = v[0] < v[1] ? v[0] : v[1];
    return m < v[2] ? m : v[2];
}

static int32_t max3(const int32_t v[3]) {
    int32_t m = v[0] > v[1] ? v[0] : v[1];
    return m > v[2] ? m : v[2];
}

/* The first and last cell whose grown square meets the closed interval [lower, upper]. */
static void cells(double lower, double upper, int32_t cell, int32_t *first, int32_t *last) {
    *first = (int32_t)ceil((lower - MARGIN) / cell) - 1;
    *last = (int32_t)floor((upper + MARGIN) / cell);
}

void coverage_rows(const struct coverage_triangle *triangle, int32_t cell, int32_t *first, int32_t *last) {
    cells(min3(triangle->y), max3(triangle->y), cell, first, last);
}

void coverage_columns(const struct coverage_triangle *triangle, int32_t cell, int32_t row, int32_t *first,
                      int32_t *last) {
    const int32_t *x = triangle->x, *y = triangle->y;
    int32_t bottom = row * cell - MARGIN, top = (row + 1) * cell + MARGIN;
    double lower = INFINITY, upper = -INFINITY;
    for (int i = 0; i < 3; i++) {
        int j = i == 2 ? 0 : i + 1;
        if (y[i] >= bottom && y[i] <= top) {
            lower = fmin(lower, x[i]);
            upper = fmax(upper, x[i]);
        }
        const int32_t border[2] = {bottom, top};
        for (int k = 0; k < 2; k++) {
            if ((y[i] < border[k]) == (y[j] < border[k]))
                continue;
            double crossing = x[i] + (double)(x[j] - x[i]) * (border[k] - y[i]) / (y[j] - y[i]);
            lower = fmin(lower, crossing);
            upper = fmax(upper, crossing);
        }
    }
    cells(lower, upper, cell, first, last);
}
