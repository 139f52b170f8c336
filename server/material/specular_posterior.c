/* specular_posterior.c -- see specular_posterior.h.
 *
 * With the prior P(c) of a candidate, the likelihood L_u(c) of the observations of segment u and the probability q_u
 * that u is of the common material, the other segments' evidence for that material is
 *
 *   G(c) ~ P(c) * product over u of (q_u * L_u(c) + (1 - q_u) * sum over d of P(d) L_u(d)),
 *
 * and the segment's own prior becomes q G(c) + (1 - q) P(c). */
#include "server/material/specular_posterior.h"

#include <math.h>

/* Prior probability of a diffuse segment: of small ones, and of those that are at least LARGE_PART of the surface, most
 * of which are painted walls and ceilings. The others are dielectrics, most with an index of refraction near 1.5
 * (specular .5), and likelier the smoother: what has a highlight is varnished or polished. No
 * statistics were taken: the odds are about 1 : 2 and 2 : 1, which some observations of a highlight outweigh. */
#define DIFFUSE_PRIOR 0.35       /* +25 %: -0.01 dB */
#define DIFFUSE_PRIOR_LARGE 0.65 /* +25 %: +0.06 dB, roughness -0.10, specular -0.46 */
#define LARGE_PART 0.05          /* +25 %: 0 dB */
/* Prior probability that a segment without clean observations is darker than the unknown material. Chosen on bathroom
 * and den, where most that seem so by one or two standard errors are glossy: with .5 den loses .35 dB of roughness. */
#define DARKER_PRIOR 0.1
/* Probability that two segments of the same colour share a material. It falls as a normal distribution of the
 * difference of the cube roots of the colours (a perceptual scale), whose deviation is that of base colour errors. */
#define COMMON 0.8        /* +25 %: 0 dB */
#define COLOR_SPREAD 0.04 /* +25 %: 0 dB */
#define COMMON_MIN 0.02   /* less counts as 0; +25 %: no change */

static const double level_prior[HIGHLIGHT_SPECULARS] = {0.05, 0.15, 0.5, 0.15, 0.15};

void specular_prior(double part, double prior[SPECULAR_CANDIDATES]) {
    double diffuse = DIFFUSE_PRIOR + (DIFFUSE_PRIOR_LARGE - DIFFUSE_PRIOR) * fmin(part / LARGE_PART, 1.0), sum = 0.0;
    for (size_t k = 0; k < HIGHLIGHT_ROUGHNESSES; k++) {
        for (size_t m = 0; m < HIGHLIGHT_SPECULARS; m++) {
            float roughness = specular_levels.roughness[k];
            double p = roughness > SPECULAR_MAX_ROUGHNESS ? 0.0 : (double)(1.0f - roughness) * level_prior[m];
            prior[specular_candidate(k, m)] = p;
            sum += p;
        }
    }
    for (size_t c = 0; c < SPECULAR_CANDIDATES; c++)
        prior[c] *= (1.0 - diffuse) / sum;
    prior[SPECULAR_DIFFUSE] = diffuse;
}

/* Element-wise product; returns its sum. */
static double multiply(const double a[SPECULAR_CANDIDATES], const double b[SPECULAR_CANDIDATES],
                       double product[SPECULAR_CANDIDATES]) {
    double sum = 0.0;
    for (size_t c = 0; c < SPECULAR_CANDIDATES; c++) {
        product[c] = a[c] * b[c];
        sum += product[c];
    }
    return sum;
}

/* Probability that two segments share a material, given their colours: by the distance of both distributions, were they
 * normal (the second Wasserstein distance). */
static double shared_probability(const struct specular_evidence *a, const struct specular_evidence *b) {
    const float *p = &a->base_color.r, *q = &b->base_color.r;
    const float *spread_p = &a->color_spread.r, *spread_q = &b->color_spread.r;
    double squares = 0.0;
    if (a->part > LARGE_PART || b->part > LARGE_PART)
        return 0.0;
    for (size_t i = 0; i < 3; i++) {
        double d = cbrt((double)p[i]) - cbrt((double)q[i]);
        double spread = (double)spread_p[i] - (double)spread_q[i];
        squares += (d * d + spread * spread) / 3.0;
    }
    double chance = COMMON * exp(-0.5 * squares / (COLOR_SPREAD * COLOR_SPREAD));
    return chance > COMMON_MIN ? chance : 0.0;
}

/* Multiplies the distribution of the common material by the evidence of another segment, and normalises it. */
static void add_evidence(const struct specular_evidence *other, double chance, double belief[SPECULAR_CANDIDATES]) {
    double prior[SPECULAR_CANDIDATES], own[SPECULAR_CANDIDATES], sum = 0.0;
    specular_prior(other->part, prior);
    double is_observed = multiply(prior, other->likelihood, own);
    for (size_t c = 0; c < SPECULAR_CANDIDATES; c++) {
        belief[c] *= chance * other->likelihood[c] + (1.0 - chance) * is_observed;
        sum += belief[c];
    }
    for (size_t c = 0; c < SPECULAR_CANDIDATES; c++)
        belief[c] /= sum;
}

struct specular_posterior specular_posterior(const struct specular_evidence *evidence, size_t count, size_t segment) {
    const struct specular_evidence *own = &evidence[segment];
    double prior[SPECULAR_CANDIDATES], belief[SPECULAR_CANDIDATES];
    specular_prior(own->part, prior);
    specular_prior(own->part, belief);
    for (size_t i = 0; i < count; i++) {
        double chance = i != segment && evidence[i].is_observed ? shared_probability(own, &evidence[i]) : 0.0;
        if (chance > 0.0)
            add_evidence(&evidence[i], chance, belief);
    }
    for (size_t c = 0; c < SPECULAR_CANDIDATES; c++)
        prior[c] = COMMON * belief[c] + (1.0 - COMMON) * prior[c];
    double sum = multiply(prior, own->likelihood, belief);
    struct specular_posterior result = {belief[SPECULAR_DIFFUSE] / sum, belief[SPECULAR_DIFFUSE] / sum, 0.0};
    for (size_t k = 0; k < HIGHLIGHT_ROUGHNESSES; k++) {
        for (size_t m = 0; m < HIGHLIGHT_SPECULARS; m++) {
            size_t c = specular_candidate(k, m);
            double p = belief[c] / sum;
            result.roughness += p * (c == own->best ? own->best_roughness : (double)specular_levels.roughness[k]);
            result.specular += p * (double)specular_levels.specular[m];
        }
    }
    return result;
}

struct specular_posterior specular_posterior_unobserved(double errors) {
    double likelihood = errors < 0.0 ? exp(-0.5 * errors * errors) : 1.0;
    double diffuse = DARKER_PRIOR / (DARKER_PRIOR + (1.0 - DARKER_PRIOR) * likelihood);
    double share = (1.0 - diffuse) / (1.0 - DARKER_PRIOR); /* of the unknown material; 1 where nothing tells */
    return (struct specular_posterior){diffuse, 1.0 - share * (1.0 - (double)SPECULAR_UNKNOWN_ROUGHNESS),
                                       share * (double)SPECULAR_UNKNOWN_SPECULAR};
}
