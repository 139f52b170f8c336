/* cholesky_band.h -- systems with a symmetric positive definite band matrix, by its Cholesky factor (Golub and Van Loan
 * 1996, 4.3.5), which has the same band.
 *
 * A matrix is a[n][band + 1]: row i holds its columns i - band to i; what would lie left of column 0 is not used. */
#ifndef UNBAKE_COMMON_CHOLESKY_BAND_H
#define UNBAKE_COMMON_CHOLESKY_BAND_H

#include <stddef.h>

/* Replaces `a`, which must be positive definite, by its lower factor: n (band + 1)^2 operations. */
void cholesky_band_factor(size_t n, size_t band, double *a);

/* Replaces the right side x[n] by the solution, given the factor. */
void cholesky_band_solve(size_t n, size_t band, const double *factor, double *x);

#endif
