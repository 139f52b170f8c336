/* specular_posterior.h -- posterior of a segment's specular lobe, from its own observations and those of segments of
 * similar base colour.
 *
 * Observations seldom determine the lobe of small objects, but parts of one colour are often of one material: a door
 * and its frame, the legs of a table. Segments of similar base colour are modelled as sharing one common material, each
 * with a probability that falls with the difference of the colours, of their means and of how they vary over a segment:
 * a picture is not of the paint that its mean happens to have. Otherwise a segment's material is independent. Segments
 * whose observations disagree hardly influence each other. Large segments do not take part: most are painted
 * walls, and many unrelated objects are white too. */
#ifndef UNBAKE_MATERIAL_SPECULAR_POSTERIOR_H
#define UNBAKE_MATERIAL_SPECULAR_POSTERIOR_H

#include <stdbool.h>
#include <stddef.h>

#include "common/vec.h"
#include "server/material/specular_observation.h"

/* Candidate 0 is diffuse; the others are all pairs of specular_levels. */
#define SPECULAR_CANDIDATES (1 + HIGHLIGHT_ROUGHNESSES * HIGHLIGHT_SPECULARS)
#define SPECULAR_DIFFUSE 0 /* its index */

/* Index of the candidate with levels k of roughness and m of specular. */
static inline size_t specular_candidate(size_t k, size_t m) { return 1 + k * HIGHLIGHT_SPECULARS + m; }

/* Prior of rougher lobes is 0: they cannot be distinguished from diffuse reflection. At .8 large walls still tell by 3
 * to 10 standard errors. */
#define SPECULAR_MAX_ROUGHNESS 0.8f /* +25 %: no change */

/* Material of a segment without clean observations: half way to an ordinary dielectric, which limits the error of base
 * colour to 2 % either way. */
#define SPECULAR_UNKNOWN_ROUGHNESS 0.5f /* +25 %: 0 dB, roughness -0.15 */
#define SPECULAR_UNKNOWN_SPECULAR 0.25f /* +25 %: 0 dB, specular +0.16 */

struct specular_evidence {
    bool is_observed; /* the segment has enough observations; else the other fields are undefined */
    double part;      /* of the room's texels */
    rgb base_color;
    rgb color_spread;                       /* standard deviation of its cube root over the texels */
    double likelihood[SPECULAR_CANDIDATES]; /* of the observations under each candidate, at most 1 */
    size_t best;                            /* the likeliest candidate */
    double best_roughness;                  /* refined between the levels */
};

/* Probability of the diffuse candidate, and posterior means over all candidates. */
struct specular_posterior {
    double diffuse, roughness, specular;
};

/* Prior of each candidate for a segment that has this part of the surface; sums to 1. */
void specular_prior(double part, double prior[SPECULAR_CANDIDATES]);

/* Posterior of `segment`, whose evidence[segment].is_observed must be true; evidence[count]. */
struct specular_posterior specular_posterior(const struct specular_evidence *evidence, size_t count, size_t segment);

/* The same without clean observations. `errors`: misfit of a diffuse material less that of the unknown one, in standard
 * errors; only what is below 0 tells: that is darker than the unknown one allows. */
struct specular_posterior specular_posterior_unobserved(double errors);

#endif
