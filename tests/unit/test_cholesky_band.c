/* cholesky_band.h against cholesky.h: the same factor and solution of band matrices, in any width of band. */
#include "common/cholesky_band.h"

#include <string.h>

#include "common/cholesky.h"
#include "common/rng.h"
#include "tests/check.h"

#define N 23

static double random_number(uint64_t a, uint64_t b) { return (double)rng_to_float((uint32_t)rng_key(7, a, b)) - 0.5; }

static void check_band(size_t band) {
    double dense[N][N] = {{0.0}}, narrow[N * (N + 1)], x[N], y[N];
    for (size_t i = 0; i < N * (band + 1); i++)
        narrow[i] = NAN; /* what lies left of column 0 is not read */
    for (size_t i = 0; i < N; i++) {
        x[i] = y[i] = random_number(i, 100);
        for (size_t j = i > band ? i - band : 0; j <= i; j++) {
            dense[i][j] = random_number(i, j) + (i == j ? (double)band + 1.0 : 0.0);
            narrow[i * (band + 1) + band - i + j] = dense[i][j];
        }
    }
    CHECK(cholesky_factor(N, N, &dense[0][0]));
    cholesky_band_factor(N, band, narrow);
    for (size_t i = 0; i < N; i++)
        for (size_t j = i > band ? i - band : 0; j <= i; j++)
            CHECK_NEAR(narrow[i * (band + 1) + band - i + j], dense[i][j], 1e-13);
    cholesky_solve(N, N, &dense[0][0], x);
    cholesky_band_solve(N, band, narrow, y);
    for (size_t i = 0; i < N; i++)
        CHECK_NEAR(y[i], x[i], 1e-13);
}

int main(void) {
    for (size_t band = 0; band < N; band++)
        check_band(band);
    return check_result();
}
