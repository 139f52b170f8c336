/* cholesky_band.c -- see cholesky_band.h. */
#include "common/cholesky_band.h"

#include <math.h>

static size_t first_column(size_t row, size_t band) { return row > band ? row - band : 0; }

void cholesky_band_factor(size_t n, size_t band, double *a) {
    for (size_t i = 0; i < n; i++) {
        double *row = a + i * (band + 1) + band - i; /* by column, as is `other` */
        size_t first = first_column(i, band);
        for (size_t j = first; j < i; j++) {
            const double *other = a + j * (band + 1) + band - j;
            double sum = row[j];
            for (size_t k = first; k < j; k++)
                sum -= row[k] * other[k];
            row[j] = sum / other[j];
        }
        double sum = row[i];
        for (size_t k = first; k < i; k++)
            sum -= row[k] * row[k];
        row[i] = sqrt(sum);
    }
}

void cholesky_band_solve(size_t n, size_t band, const double *factor, double *x) {
    for (size_t i = 0; i < n; i++) {
        const double *row = factor + i * (band + 1) + band - i;
        for (size_t k = first_column(i, band); k < i; k++)
            x[i] -= row[k] * x[k];
        x[i] /= row[i];
    }
    for (size_t i = n; i-- > 0;) {
        const double *row = factor + i * (band + 1) + band - i;
        x[i] /= row[i];
        for (size_t k = first_column(i, band); k < i; k++)
            x[k] -= row[k] * x[i];
    }
}
