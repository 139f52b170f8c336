/* gloss_belief.c -- see gloss_belief.h.
 *
 * With the prior P(c) of a candidate, the likelihood L_u(c) of what segment u shows and the probability q_u that u is of the
 * common material, what the others tell of that is
 *
 *   G(c) ~ P(c) * product over u of (q_u * L_u(c) + (1 - q_u) * sum over d of P(d) L_u(d)),
 *
 * and the prior of the segment itself becomes q G(c) + (1 - q) P(c). */
#include "server/material/gloss_belief.h"

#include <math.h>

/* Before anything is seen, so many of the segments that are hard to tell are matt, and of those that are a large
 * part of the surface, which mostly are painted walls and ceilings. Others are dielectrics, most of
 * them near an index of refraction of 1.5 (specular .5), and the likelier the smoother: what has a highlight is
 * varnished or polished. */
#define MATT_PRIOR 0.35
#define MATT_PRIOR_LARGE 0.65
#define LARGE_PART 0.05
/* Of one colour, so many are of one material; that falls with the difference between the cube roots of colours (which are
 * about as different as they look), by a normal distribution: base colours so far are off by some percent. */
#define COMMON 0.8
#define COLOR_SPREAD 0.04
#define COMMON_LEAST 0.02 /* less is nothing */

static const double specular_prior[HIGHLIGHT_SPECULARS] = {0.05, 0.15, 0.5, 0.15, 0.15};

/* How likely each candidate is before anything is seen of a segment that has this part of the surface. */
static void prior_of(double part, double prior[GLOSS_CANDIDATES]) {
    double matt = MATT_PRIOR + (MATT_PRIOR_LARGE - MATT_PRIOR) * fmin(part / LARGE_PART, 1.0), sum = 0.0;
    for (size_t k = 0; k < HIGHLIGHT_ROUGHNESSES; k++) {
        for (size_t m = 0; m < HIGHLIGHT_SPECULARS; m++) {
            float roughness = gloss_levels.roughness[k];
            double p = roughness > GLOSS_ROUGHEST ? 0.0 : (double)(1.0f - roughness) * specular_prior[m];
            prior[gloss_candidate(k, m)] = p;
            sum += p;
        }
    }
    for (size_t c = 0; c < GLOSS_CANDIDATES; c++)
        prior[c] *= (1.0 - matt) / sum;
    prior[GLOSS_MATT] = matt;
}

static double multiply(const double a[GLOSS_CANDIDATES], const double b[GLOSS_CANDIDATES], double product[GLOSS_CANDIDATES]) {
    double sum = 0.0;
    for (size_t c = 0; c < GLOSS_CANDIDATES; c++) {
        product[c] = a[c] * b[c];
        sum += product[c];
    }
    return sum;
}

/* The probability that two segments are of one material, as far as their colours tell. */
static double common(const struct gloss_told *a, const struct gloss_told *b) {
    const float *p = &a->base_color.r, *q = &b->base_color.r;
    double squares = 0.0;
    if (a->part > LARGE_PART || b->part > LARGE_PART)
        return 0.0;
    for (size_t i = 0; i < 3; i++) {
        double d = cbrt((double)p[i]) - cbrt((double)q[i]);
        squares += d * d / 3.0;
    }
    double chance = COMMON * exp(-0.5 * squares / (COLOR_SPREAD * COLOR_SPREAD));
    return chance > COMMON_LEAST ? chance : 0.0;
}

/* Multiplies the belief in the common material by what another segment tells of it. */
static void hear(const struct gloss_told *other, double chance, double belief[GLOSS_CANDIDATES]) {
    double prior[GLOSS_CANDIDATES], own[GLOSS_CANDIDATES], sum = 0.0;
    prior_of(other->part, prior);
    double any = multiply(prior, other->likelihood, own);
    for (size_t c = 0; c < GLOSS_CANDIDATES; c++) {
        belief[c] *= chance * other->likelihood[c] + (1.0 - chance) * any;
        sum += belief[c];
    }
    for (size_t c = 0; c < GLOSS_CANDIDATES; c++)
        belief[c] /= sum;
}

struct gloss_belief gloss_believe(const struct gloss_told *told, size_t count, size_t segment) {
    const struct gloss_told *own = &told[segment];
    double prior[GLOSS_CANDIDATES], belief[GLOSS_CANDIDATES];
    prior_of(own->part, prior);
    prior_of(own->part, belief);
    for (size_t i = 0; i < count; i++) {
        double chance = i != segment && told[i].any ? common(own, &told[i]) : 0.0;
        if (chance > 0.0)
            hear(&told[i], chance, belief);
    }
    for (size_t c = 0; c < GLOSS_CANDIDATES; c++)
        prior[c] = COMMON * belief[c] + (1.0 - COMMON) * prior[c];
    double sum = multiply(prior, own->likelihood, belief);
    struct gloss_belief result = {belief[GLOSS_MATT] / sum, belief[GLOSS_MATT] / sum, 0.0};
    for (size_t k = 0; k < HIGHLIGHT_ROUGHNESSES; k++) {
        for (size_t m = 0; m < HIGHLIGHT_SPECULARS; m++) {
            size_t c = gloss_candidate(k, m);
            double p = belief[c] / sum;
            result.roughness += p * (c == own->best ? own->best_roughness : (double)gloss_levels.roughness[k]);
            result.specular += p * (double)gloss_levels.specular[m];
        }
    }
    return result;
}
