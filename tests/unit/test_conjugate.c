/* conjugate.h: a system of n unknowns is solved in n steps, and a good preconditioner needs fewer. */
#include "server/capture/conjugate.h"

#include "tests/check.h"

#define N 5

/* A chain of springs between fixed ends, each mass held besides: symmetric and positive. */
struct chain {
    double hold[N];
    int multiply_count;
};

static void multiply(const void *user, const double *x, double *out) {
    struct chain *chain = (struct chain *)user;
    chain->multiply_count++;
    for (int i = 0; i < N; i++)
        out[i] = (2.0 + chain->hold[i]) * x[i] - (i > 0 ? x[i - 1] : 0.0) - (i + 1 < N ? x[i + 1] : 0.0);
}

static void leave(const void *user, const double *residual, double *out) {
    (void)user;
    memcpy(out, residual, N * sizeof *out);
}

static void divide_by_diagonal(const void *user, const double *residual, double *out) {
    const struct chain *chain = user;
    for (int i = 0; i < N; i++)
        out[i] = residual[i] / (2.0 + chain->hold[i]);
}

/* Steps until the residual is a millionth of what it was at first. */
static int solve(struct chain *chain, void (*precondition)(const void *, const double *, double *)) {
    static const double wanted[N] = {1.0, -2.0, 3.0, 0.5, 4.0};
    const struct conjugate_system system = {N, multiply, precondition, chain};
    double x[N] = {0.3, 0.1, 0.0, 0.0, -7.0}, residual[N];
    multiply(chain, wanted, residual);
    conjugate_residual(&system, x, residual);
    double goal = 1e-12 * conjugate_dot(residual, residual, N);
    chain->multiply_count = 0;
    conjugate_solve(&system, 2 * N, goal, residual, x);
    for (int i = 0; i < N; i++)
        CHECK_NEAR(x[i], wanted[i], 1e-4);
    CHECK(conjugate_dot(residual, residual, N) <= goal);
    return chain->multiply_count;
}

int main(void) {
    struct chain even = {.hold = {0.1, 0.2, 0.3, 0.2, 0.1}};
    struct chain uneven = {.hold = {1e4, 1e2, 1e5, 1e3, 1e6}};
    CHECK(solve(&even, leave) <= N);
    int plain = solve(&uneven, leave), preconditioned = solve(&uneven, divide_by_diagonal);
    CHECK_THAT(preconditioned < plain, "%d steps, %d without", preconditioned, plain);
    return check_result();
}
