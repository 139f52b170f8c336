/* reflection.h -- whether white paint, glossy perhaps, may show what a segment shows.
 *
 * L observed radiance, W what a white Lambertian surface of albedo 1 would send. A segment that reflects has, with the
 * lobe c,
 *
 *   log L <= log(g W (a + h_c)) + e,   a = ALBEDO_WHITE,   e ~ N(0, s),
 *   s^2 = ALBEDO_WHITE_DEVIATION^2 + (f u)^2 + log(1 + (D / W)^2).
 *
 * h_c is the albedo that the lobe's highlight feigns: what it would reflect towards the photographs over W, their
 * median, since L is one. Each lobe is as likely as the prior of gloss says (specular_posterior.h). u is the share of W
 * that comes from unobserved sky, f the deviation of that, D that of light that is not modelled, lognormal about W. g
 * is what arrives around the edges of a scan over what arrives here (edge_light.h).
 *
 * Of a saturated lamp L is inferred from what it lights, which may hardly tell it: its own deviation adds to s. That it
 * shows its lower bound at least is sure. It emits if reflection would show either as seldom. */
#ifndef UNBAKE_LIGHT_DECISION_REFLECTION_H
#define UNBAKE_LIGHT_DECISION_REFLECTION_H

#include <math.h>

#include "server/light/light_priors.h"
#include "server/material/divide.h"
#include "server/state/reconstruction.h"

/* A segment emits if reflection shows as much more seldom than a normal deviate exceeds so many deviations. A false
 * lamp takes the place of others' light, a missed one stays as base colour. */
#define REFLECTION_DEVIATIONS 3.0f

/* Least radiance, in W, of what surely emits, where nothing is glossy and this share of light is of a fitted sky. */
static inline float reflection_limit(float fitted_share) {
    float sky = (float)FIT_DEVIATION * fitted_share, white = (float)ALBEDO_WHITE_DEVIATION;
    return (float)ALBEDO_WHITE * expf(REFLECTION_DEVIATIONS * sqrtf(white * white + sky * sky));
}

/* Standard deviation of log W: `lambert`, `sky` of it from a sky of that deviation, and light that is not modelled, of
 * a deviation of `dark`, by which W is surer in bright places than in a dark corner. */
static inline double reflection_light_deviation(double lambert, double sky, double sky_deviation, double dark) {
    double within = fmax(lambert, 1e-30), share = fmin(sky / within, 1.0) * sky_deviation;
    return sqrt(ALBEDO_WHITE_DEVIATION * ALBEDO_WHITE_DEVIATION + share * share +
                log1p(dark / within * (dark / within)));
}

/* Probability that a surface of this albedo reflects as much as the segment shows, by `radiance` and `lambert`, where
 * log W has this deviation. */
double reflection_probability(const struct emitter_evidence *evidence, double albedo, double deviation);

/* Sets `sky_lambert` and `reflection` of r->evidence[segment], with texel[count], by its `radiance` and `lambert`.
 * `thread` picks of d->scratch. */
void reflection_find(struct reconstruction *r, const struct divide *d, uint32_t segment, const uint32_t *texel,
                     size_t count, int thread);

/* Whether the segment emits by that. */
bool reflection_is_unlikely(const struct emitter_evidence *evidence);

#endif
