/* symmetric_sum.c -- see symmetric_sum.h. */
#include "server/light/sun/symmetric_sum.h"

#include <math.h>
#include <string.h>

#define STEPS 60 /* halvings of the interval in which the tilt is sought */

/* With a common factor c of all odds, the tilt, item i is chosen with probability p_i = c w_i / (1 + c w_i). */
static double chosen_with(const double *weight, size_t count, double tilt) {
    double sum = 0.0;
    for (size_t i = 0; i < count; i++)
        sum += tilt * weight[i] / (1.0 + tilt * weight[i]);
    return sum;
}

/* The tilt with which `chosen` are expected, so that just as many are likely. */
static double find_tilt(const double *weight, size_t count, size_t chosen) {
    double least = weight[0], most = weight[0];
    for (size_t i = 1; i < count; i++)
        least = fmin(least, weight[i]), most = fmax(most, weight[i]);
    double odds = (double)chosen / (double)(count - chosen), low = log(odds / most), high = log(odds / least);
    for (int i = 0; i < STEPS && high - low > 1e-3; i++) {
        double middle = 0.5 * (low + high);
        if (chosen_with(weight, count, exp(middle)) < (double)chosen)
            low = middle;
        else
            high = middle;
    }
    return exp(0.5 * (low + high));
}

double symmetric_sum_log(const double *weight, size_t count, size_t chosen, double *chance) {
    double log_all = 0.0;
    if (chosen == 0)
        return 0.0;
    for (size_t i = 0; i < count && chosen == count; i++)
        log_all += log(weight[i]);
    if (chosen == count)
        return log_all;
    double tilt = find_tilt(weight, count, chosen);
    memset(chance, 0, (chosen + 1) * sizeof *chance);
    chance[0] = 1.0; /* that k of the items so far are chosen, by k */
    for (size_t i = 0; i < count; i++) {
        double p = tilt * weight[i] / (1.0 + tilt * weight[i]);
        for (size_t k = i + 1 < chosen ? i + 1 : chosen; k > 0; k--)
            chance[k] = (1.0 - p) * chance[k] + p * chance[k - 1];
        chance[0] *= 1.0 - p;
        log_all += log1p(tilt * weight[i]);
    }
    return log(chance[chosen]) + log_all - (double)chosen * log(tilt);
}
