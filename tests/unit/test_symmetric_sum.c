/* symmetric_sum.h: against sums over all sets of a few items, against binomial coefficients of many, and of odds that
 * differ by ten orders of magnitude. */
#include "server/light/sun/symmetric_sum.h"

#include <math.h>

#include "tests/check.h"

#define FEW 10
#define MANY 4000

static double sum_over_sets(const double *weight, size_t count, size_t chosen) {
    double sum = 0.0;
    for (unsigned set = 0; set < 1u << count; set++) {
        double product = 1.0;
        size_t members = 0;
        for (size_t i = 0; i < count; i++) {
            if (set >> i & 1u)
                product *= weight[i], members++;
        }
        sum += members == chosen ? product : 0.0;
    }
    return sum;
}

static void check_few(const double *weight) {
    double chance[FEW + 1];
    for (size_t chosen = 0; chosen <= FEW; chosen++) {
        double expected = log(sum_over_sets(weight, FEW, chosen));
        CHECK_NEAR(symmetric_sum_log(weight, FEW, chosen, chance), expected, 1e-9 * fmax(1.0, fabs(expected)));
    }
}

int main(void) {
    static double alike[MANY], chance[MANY + 1];
    const double mild[FEW] = {1, 20, 1, 1, 20, 3, 0.5, 7, 20, 2};
    const double wide[FEW] = {1e-5, 1e5, 1, 3e-4, 2e3, 1e-5, 40, 0.1, 9e4, 1e-2};
    check_few(mild);
    check_few(wide);
    for (size_t i = 0; i < MANY; i++)
        alike[i] = 3.0;
    for (size_t chosen = 1; chosen < MANY; chosen += 799) {
        double n = MANY, k = (double)chosen,
               expected = lgamma(n + 1) - lgamma(k + 1) - lgamma(n - k + 1) + k * log(3.0);
        CHECK_NEAR(symmetric_sum_log(alike, MANY, chosen, chance), expected, 1e-6 * expected);
    }
    return check_result();
}
