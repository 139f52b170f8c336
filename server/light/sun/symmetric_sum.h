/* symmetric_sum.h -- elementary symmetric polynomials, by which one says how likely it is that of some items, of given
 * odds, just these were chosen when it is known how many were.
 *
 * Of n items with odds w_i, independent of each other, s are chosen. Given s it is a certain set C with probability
 *
 *     prod over C of w_i / e_s(w),    e_s(w) = sum over all sets of s items of the products of their w_i
 *
 * (conditional logistic regression: Breslow, Day, Halvorsen, Prentice and Sabai 1978). */
#ifndef UNBAKE_LIGHT_SUN_SYMMETRIC_SUM_H
#define UNBAKE_LIGHT_SUN_SYMMETRIC_SUM_H

#include <stddef.h>

/* log e_s of weight[count] > 0, chosen <= count; chance[chosen + 1] is scratch. Also of many items, of which e_s itself
 * would exceed all numbers. */
double symmetric_sum_log(const double *weight, size_t count, size_t chosen, double *chance);

#endif
