/* chi_square.h -- Pearson's test of counts against expectations. */
#ifndef UNBAKE_TESTS_RENDER_CHI_SQUARE_H
#define UNBAKE_TESTS_RENDER_CHI_SQUARE_H

#include "tests/check.h"

/* Standard normal deviate of the statistic (Wilson and Hilferty 1931). Cells that expect fewer
 * than 5 are pooled. */
static inline double chi_square(size_t cells, const double *found, const double *expected) {
    double statistic = 0.0, pooled_found = 0.0, pooled_expected = 0.0;
    double degrees = -1.0;
    for (size_t i = 0; i < cells; i++) {
        if (expected[i] < 5.0) {
            pooled_found += found[i];
            pooled_expected += expected[i];
            continue;
        }
        statistic += (found[i] - expected[i]) * (found[i] - expected[i]) / expected[i];
        degrees += 1.0;
    }
    if (pooled_expected >= 1.0) {
        statistic += (pooled_found - pooled_expected) * (pooled_found - pooled_expected) / pooled_expected;
        degrees += 1.0;
    } else if (pooled_found > 10.0 + 10.0 * pooled_expected) {
        return INFINITY; /* samples where there should be none */
    }
    double spread = 2.0 / (9.0 * degrees);
    return (cbrt(statistic / degrees) - (1.0 - spread)) / sqrt(spread);
}

#endif
