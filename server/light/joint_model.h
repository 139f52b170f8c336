/* joint_model.h -- the model of joint_fit.h: points, sources, priors, and the likelihood of the points of a segment. */
#ifndef UNBAKE_LIGHT_JOINT_MODEL_H
#define UNBAKE_LIGHT_JOINT_MODEL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/parallel.h"
#include "server/light/light_priors.h"

struct joint_point {
    uint32_t segment, patch; /* points of a segment are adjacent, and in it those of a patch */
    float observed, known;   /* radiances > 0: O_i, E_i */
    float deviation;         /* standard deviation of b_i by noise of E_i and by highlights */
    bool is_bound;           /* O_i is a lower bound */
    bool is_lamp;            /* it has none at all; what it gets of light is asked for */
};

/* A source. The prior of theta is normal, cut at `least`. */
struct joint_source {
    double mean, deviation; /* of the prior */
    double least;           /* lower bound of theta; -INFINITY: none */
    double value;           /* theta: the estimate */
    double error;           /* standard deviation of the posterior, by joint_fit_errors */
    double share;           /* of the light of a point, the mean of all points, by the same */
};

/* A prior on the difference of two sources: normal about `difference`. */
struct joint_tie {
    size_t a, b;
    double difference, deviation; /* of theta[a] - theta[b] */
};

/* The points of a segment. */
struct joint_block {
    size_t first, end;             /* points */
    size_t first_patch, end_patch; /* in joint_fit.patch */
};

struct joint_fit {
    struct parallel *pool; /* borrowed */
    size_t point_count, source_count, source_max;
    const struct joint_point *point; /* [point_count]; borrowed */
    float *response;                 /* [point_count][source_max] R; owned, as all below */
    struct joint_source *source;     /* [source_max] the first one is no light, but the logarithm of white paint */
    size_t tie_count;
    const struct joint_tie *tie; /* borrowed */
    size_t block_count, patch_count;
    struct joint_block *block; /* [block_count] */
    size_t *patch;             /* [patch_count + 1] first point of each patch */
    double light_error;        /* standard deviation of the logarithm of light, the mean of all points, by
                                * joint_fit_errors: an error that all albedos share */
};

/* x[source_count]: the sources' radiances exp(value). The first result is the caller's. */
double *joint_fit_radiances(const struct joint_fit *f);
/* Light at a point, for sources of radiances x[source_count]. */
double joint_fit_light(const struct joint_fit *f, size_t point, const double *x);

/* Scratch for the points of the largest block. */
struct joint_scratch {
    double *base;      /* [points] b */
    double *effective; /* [points] the same, but of lower bounds what would pull as they do */
    double *residual;  /* [points] epsilon */
    double *weight;    /* [points] of residual^2 / 2 in the reweighted problem */
    float *sorted;     /* [points] */
    double *offset;    /* [patches] eta */
    double *stiffness; /* [patches] weight of eta^2 / 2 */
    double mean;       /* mu */
};

void joint_scratch_init(struct joint_scratch *s, const struct joint_fit *f);
void joint_scratch_release(struct joint_scratch *s);

/* Fills base[] for a block. */
void joint_find_base(const struct joint_fit *f, const struct joint_block *block, const double *x,
                     struct joint_scratch *s);
/* Fills the scratch for a block from base[0, end - first), and returns its share of the loss. */
double joint_settle(const struct joint_fit *f, const struct joint_block *block, struct joint_scratch *s);

/* The bound of a patch's albedo by white paint: its part of the loss, and the derivatives of that by `beyond`, the mean
 * of the patch's b less the logarithm of white paint. variance: of that mean by noise of its points. */
struct joint_white_bound {
    double loss, slope, curvature;
};
struct joint_white_bound joint_white_bound(double beyond, double variance);

#endif
