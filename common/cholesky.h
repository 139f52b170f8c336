/* cholesky.h -- small dense systems with a symmetric positive definite matrix, by its Cholesky factor.
 *
 * A matrix is a[n][stride], row-major; only its lower triangle is read and written. */
#ifndef UNBAKE_COMMON_CHOLESKY_H
#define UNBAKE_COMMON_CHOLESKY_H

#include <stdbool.h>
#include <stddef.h>

/* Replaces `a` by its lower factor. False, with `a` destroyed, when it is singular: a pivot of at most 1e-9 of its
 * diagonal entry. */
bool cholesky_factor(size_t n, size_t stride, double *a);

/* Replaces the right side x[n] by the solution, given the factor. */
void cholesky_solve(size_t n, size_t stride, const double *factor, double *x);

#endif
