/* cholesky.c -- see cholesky.h. */
#include "common/cholesky.h"

#include <math.h>

#define MIN_PIVOT 1e-9 /* of the diagonal entry; rounding leaves some 1e-15 of it */

bool cholesky_factor(size_t n, size_t stride, double *a) {
    for (size_t i = 0; i < n; i++) {
        double *row = a + i * stride, whole = row[i];
        for (size_t j = 0; j <= i; j++) {
            const double *other = a + j * stride;
            double sum = row[j];
            for (size_t k = 0; k < j; k++)
                sum -= row[k] * other[k];
            if (i == j && sum <= MIN_PIVOT * whole)
                return false;
            row[j] = i == j ? sqrt(sum) : sum / other[j];
        }
    }
    return true;
}

void cholesky_solve(size_t n, size_t stride, const double *factor, double *x) {
    for (size_t i = 0; i < n; i++) {
        for (size_t k = 0; k < i; k++)
            x[i] -= factor[i * stride + k] * x[k];
        x[i] /= factor[i * stride + i];
    }
    for (size_t i = n; i-- > 0;) {
        for (size_t k = i + 1; k < n; k++)
            x[i] -= factor[k * stride + i] * x[k];
        x[i] /= factor[i * stride + i];
    }
}
