/* tone_curve.h -- what a camera does to tones beyond sRGB: an S that makes shadows darker and highlights brighter, a
 * shoulder that holds highlights back.
 *
 * Stored values v are those of photograph.h, linear if the file is sRGB. With s = log v a camera with a curve stores
 * what is in truth
 *
 *      F(s) = s + sum_k term_k b_k(s),
 *
 * up to a factor. The b_k are orthonormal over the encoded values: the first is log v, by which a power differs from
 * another; the others are polynomials of the encoded value from which constant and power are taken off. Where nothing
 * tells the exposures, a power of all radiances with all exposures explains the photographs as well (the exponential
 * ambiguity of Grossberg and Nayar 2003, Determining the Camera Response from Images): the first is 0 then. */
#ifndef UNBAKE_CAPTURE_TONE_CURVE_H
#define UNBAKE_CAPTURE_TONE_CURVE_H

#include <stdbool.h>
#include <stddef.h>

#include "server/scene/scene.h"

#define TONE_TERMS 4 /* the power, and three of shape */
#define TONE_POWER 0

struct tone_curve {
    double term[TONE_TERMS]; /* all 0: there is none */
};

/* Values of s between which the basis is interpolated. */
#define TONE_NODES 256

/* A curve, and the basis, at equally spaced s. */
struct tone_table {
    double basis[TONE_NODES][TONE_TERMS];
    double straight[TONE_NODES]; /* F; rises */
};

/* Of no curve. */
void tone_table_init(struct tone_table *t);
/* False, and nothing is changed, unless the curve rises everywhere, by a slope between 1/20 and 20. */
bool tone_table_set(struct tone_table *t, const struct tone_curve *curve);

/* b_k at s; outside of what is tabulated (from 1/500 to 1) its value at the end. */
void tone_basis(const struct tone_table *t, double s, double basis[TONE_TERMS]);
/* F(s), and the s of which it is F: beyond the ends a straight line of slope 1. */
double tone_straight(const struct tone_table *t, double s);
double tone_stored(const struct tone_table *t, double straight);

/* Puts the pixels of all photographs that are not HDR, and their clip, to exp(F); those are straight from then on. */
void tone_straighten(const struct tone_table *t, struct scene *scene);

#endif
