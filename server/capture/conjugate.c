/* conjugate.c -- see conjugate.h. */
#include "server/capture/conjugate.h"

#include "common/mem.h"

double conjugate_dot(const double *a, const double *b, size_t count) {
    double sum = 0.0;
    for (size_t i = 0; i < count; i++)
        sum += a[i] * b[i];
    return sum;
}

void conjugate_residual(const struct conjugate_system *s, const double *x, double *b) {
    double *product = mem_array(s->count, sizeof *product);
    s->multiply(s->user, x, product);
    for (size_t i = 0; i < s->count; i++)
        b[i] -= product[i];
    mem_free(product);
}

void conjugate_solve(const struct conjugate_system *s, int steps, double goal, double *residual, double *x) {
    size_t n = s->count;
    double *memory = mem_calloc(3 * n, sizeof *memory), rz = 0.0;
    double *z = memory, *direction = z + n, *product = direction + n;
    for (int step = 0; step < steps && conjugate_dot(residual, residual, n) > goal; step++) {
        s->precondition(s->user, residual, z);
        double next = conjugate_dot(residual, z, n), beta = step > 0 ? next / rz : 0.0;
        rz = next;
        for (size_t i = 0; i < n; i++)
            direction[i] = z[i] + beta * direction[i];
        s->multiply(s->user, direction, product);
        double alpha = rz / conjugate_dot(direction, product, n);
        for (size_t i = 0; i < n; i++) {
            x[i] += alpha * direction[i];
            residual[i] -= alpha * product[i];
        }
    }
    mem_free(memory);
}
