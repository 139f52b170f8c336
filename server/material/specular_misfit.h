/* specular_misfit.h -- residuals of candidate materials at the points of a segment, and how significant the
 * difference of two candidates is.
 *
 * Errors are shared: by all observations of a point (its normal), by all of a photograph (its pose, exposure, white
 * balance, vignette), and by all of a region (the light that arrives there, the mesh). The variance of the difference
 * is that over the points, and what sums over photographs vary beyond single observations and those over regions beyond
 * single points, about their mean (Cameron, Gelbach & Miller 2011, Robust inference with multiway clustering, section
 * 2). What is summed are the effects of errors alone, and not the difference itself: a true highlight is in few
 * photographs and in one region. An error is what neither candidate explains, the smaller of both residuals, and its
 * effect is what the difference would be less without it:
 *
 *      u = rho(e_a) - rho(e_b) - rho(e_a - e_b)     where e_b is the smaller one; + where e_a is
 *
 * Residuals are in units of what the model is expected to miss and of the photographs' noise together, and what all
 * points of a segment share is a part of the misfit that noise does not explain. */
#ifndef UNBAKE_MATERIAL_SPECULAR_MISFIT_H
#define UNBAKE_MATERIAL_SPECULAR_MISFIT_H

#include <stddef.h>
#include <stdint.h>

#include "server/material/specular_observation.h"

#define SPECULAR_LEVELS (HIGHLIGHT_SPECULARS + 1) /* of specular; the first is 0: no highlight */

/* Indices into the levels of roughness and specular. */
struct specular_candidate_levels {
    size_t k, m;
};

/* Residual e of one observation under a candidate, half precision. */
struct specular_residual {
    uint16_t misfit; /* sum of rho(e) over the channels; rho(e) = e^2 / (1 + e^2) */
    uint16_t mean;   /* of e over the channels, signed */
};
typedef struct specular_residual specular_residuals[HIGHLIGHT_ROUGHNESSES][SPECULAR_LEVELS];

/* Points of one segment. All borrowed. */
struct specular_points {
    size_t count;
    float median;                   /* radiance of the photographs */
    double floor;                   /* standard error of what all points share, as a part of the misfit beyond noise */
    struct specular_sample *sample; /* [count] */
    specular_residuals *residual;   /* of the observations of sample 0, of sample 1, ... */
};

/* Fills residual[sample->count], of each observation under every candidate, with the one base colour that fits all of
 * them best. `median`: radiance of the photographs. */
void specular_misfit_find(const struct specular_sample *sample, const struct specular_prediction *prediction,
                          float median, specular_residuals *residual);

/* Sum of a candidate's misfits. */
double specular_misfit_sum(const struct specular_points *points, struct specular_candidate_levels c);

/* Misfit of candidate `a` less that of `b`. */
struct specular_gain {
    double part;   /* of a's misfit */
    double errors; /* in standard errors */
};
struct specular_gain specular_misfit_gain(const struct specular_points *points, struct specular_candidate_levels a,
                                          struct specular_candidate_levels b);

#endif
