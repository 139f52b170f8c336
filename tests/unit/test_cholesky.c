/* cholesky.h: systems whose solution is known, in matrices wider than they are; one that is singular. */
#include "common/cholesky.h"

#include <math.h>

#include "tests/check.h"

#define N 5
#define STRIDE 7

/* A A' of a lower triangular A of whole numbers, times 1, 2, ... */
static void check_known(void) {
    double lower[N][N], a[N][STRIDE] = {{0.0}}, x[N] = {0.0};
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++)
            lower[i][j] = j > i ? 0.0 : j == i ? i + 2.0 : (i * 3 + j * 5) % 7 - 3.0;
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            double sum = 0.0;
            for (int k = 0; k < N; k++)
                sum += lower[i][k] * lower[j][k];
            a[i][j] = j > i ? NAN : sum; /* the upper triangle is not read */
            x[i] += sum * (j + 1.0);
        }
    }
    CHECK(cholesky_factor(N, STRIDE, &a[0][0]));
    for (int i = 0; i < N; i++)
        for (int j = 0; j <= i; j++)
            CHECK_THAT(fabs(a[i][j] - lower[i][j]) < 1e-12, "factor %d %d: %g", i, j, a[i][j]);
    cholesky_solve(N, STRIDE, &a[0][0], x);
    for (int i = 0; i < N; i++)
        CHECK_THAT(fabs(x[i] - (i + 1.0)) < 1e-12, "x[%d] = %.15g", i, x[i]);
}

static void check_singular(void) {
    double a[3][3] = {{4.0, 0.0, 0.0}, {2.0, 1.0, 0.0}, {6.0, 3.0, 9.0}}; /* its rows are (2 1 3)' (2 1 3) */
    CHECK(!cholesky_factor(3, 3, &a[0][0]));
    double zero[1] = {0.0};
    CHECK(!cholesky_factor(1, 1, zero));
}

int main(void) {
    check_known();
    check_singular();
    return check_result();
}
