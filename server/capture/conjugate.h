/* conjugate.h -- preconditioned conjugate gradients (Hestenes & Stiefel 1952) for symmetric positive
 * systems A x = b whose matrix is never formed. */
#ifndef UNBAKE_CAPTURE_CONJUGATE_H
#define UNBAKE_CAPTURE_CONJUGATE_H

#include <stddef.h>

struct conjugate_system {
    size_t count;                                                                /* unknowns */
    void (*multiply)(const void *user, const double *x, double *out);            /* out = A x */
    void (*precondition)(const void *user, const double *residual, double *out); /* out = approximately A^-1 residual */
    const void *user;
};

/* Turns b[count] into the residual b - A x. */
void conjugate_residual(const struct conjugate_system *system, const double *x, double *b);

/* Improves x[count], whose residual[count] is given and kept up to date, until the squared norm of the residual is at
 * most `goal`, in at most `steps` steps. */
void conjugate_solve(const struct conjugate_system *system, int steps, double goal, double *residual, double *x);

double conjugate_dot(const double *a, const double *b, size_t count);

#endif
