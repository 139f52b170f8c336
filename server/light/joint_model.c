/* joint_model.c -- see joint_model.h. */
#include "server/light/joint_model.h"

#include <math.h>

#include "common/mem.h"
#include "common/quantile.h"

/* Degrees of freedom of Student's t: tails wide enough for lamps and pictures on walls. */
#define FREEDOM 4.0
#define SETTLE_ROUNDS 6

static double square(double x) { return x * x; }

void joint_scratch_init(struct joint_scratch *s, const struct joint_fit *f) {
    size_t points = 1, patches = 1;
    for (size_t k = 0; k < f->block_count; k++) {
        const struct joint_block *b = &f->block[k];
        points = b->end - b->first > points ? b->end - b->first : points;
        patches = b->end_patch - b->first_patch > patches ? b->end_patch - b->first_patch : patches;
    }
    s->base = mem_array(points, sizeof *s->base);
    s->effective = mem_array(points, sizeof *s->effective);
    s->residual = mem_array(points, sizeof *s->residual);
    s->weight = mem_array(points, sizeof *s->weight);
    s->sorted = mem_array(points, sizeof *s->sorted);
    s->offset = mem_array(patches, sizeof *s->offset);
    s->stiffness = mem_array(patches, sizeof *s->stiffness);
    s->mean = 0.0;
}

void joint_scratch_release(struct joint_scratch *s) {
    mem_free(s->base);
    mem_free(s->effective);
    mem_free(s->residual);
    mem_free(s->weight);
    mem_free(s->sorted);
    mem_free(s->offset);
    mem_free(s->stiffness);
}

double *joint_fit_radiances(const struct joint_fit *f) {
    double *x = mem_array(f->source_count + 1, sizeof *x);
    for (size_t j = 0; j < f->source_count; j++)
        x[j] = exp(f->source[j].value);
    return x;
}

double joint_fit_light(const struct joint_fit *f, size_t point, const double *x) {
    const float *row = f->response + point * f->source_max;
    double light = (double)f->point[point].known;
    for (size_t j = 0; j < f->source_count; j++)
        light += (double)row[j] * x[j];
    return light;
}

void joint_find_base(const struct joint_fit *f, const struct joint_block *b, const double *x, struct joint_scratch *s) {
    for (size_t i = b->first; i < b->end; i++)
        s->base[i - b->first] = log((double)f->point[i].observed / joint_fit_light(f, i, x));
}

/* Student's t: loss of a residual in deviations, and its weight in the reweighted least squares. */
static double t_loss(double e) { return 0.5 * (FREEDOM + 1.0) * log1p(e * e / FREEDOM); }
static double t_weight(double e) { return (FREEDOM + 1.0) / (FREEDOM + e * e); }

struct joint_white_bound joint_white_bound(double beyond, double variance) {
    double deviation = sqrt(square(ALBEDO_PATCH) + variance);
    if (!(beyond > 0.0))
        return (struct joint_white_bound){0.0, 0.0, 0.0};
    double e = beyond / deviation, weight = t_weight(e) / square(deviation);
    return (struct joint_white_bound){t_loss(e), weight * beyond, weight};
}

/* What a point contributes, for a residual in deviations: to the loss, its derivative, and a curvature that is
 * positive. */
struct pull {
    double loss, slope, weight;
};

/* Of a lower bound: the logarithm of the probability that a value of Student's t of four degrees of freedom exceeds it
 * (Tobin 1958). The weight is the true curvature where that is not small. */
static struct pull bound_pull(double e) {
    double square_e = e * e, scale = 1.0 + square_e / 4.0;
    double below = 0.5 + 0.375 * e / sqrt(scale) * (1.0 - square_e / (12.0 * scale));
    double above = fmax(1.0 - below, 1e-12), hazard = 0.375 * pow(scale, -2.5) / above;
    double curvature = fmax(hazard - 5.0 * e / (4.0 + square_e), 1.0 / (1.0 + fmax(e, 0.0)));
    return (struct pull){-log(above), hazard, hazard * curvature};
}

static struct pull pull_of(const struct joint_point *p, double e) {
    if (p->is_lamp)
        return (struct pull){0.0, 0.0, 0.0};
    if (p->is_bound)
        return bound_pull(e);
    return (struct pull){t_loss(e), t_weight(e) * e, t_weight(e)};
}

static double variance_of(const struct joint_point *p) { return square(ALBEDO_POINT) + square((double)p->deviation); }

/* Of what is measured. */
static double median_of(const struct joint_fit *f, const struct joint_block *b, struct joint_scratch *s) {
    size_t count = 0;
    for (size_t i = b->first; i < b->end; i++) {
        if (!f->point[i].is_bound && !f->point[i].is_lamp)
            s->sorted[count++] = (float)s->base[i - b->first];
    }
    return count > 0 ? (double)quantile(s->sorted, count, 0.5) : log(ALBEDO_MEAN);
}

/* Weighted sums over the points of a patch. */
struct patch_sums {
    double weight, base;
};

static struct patch_sums weigh_patch(const struct joint_fit *f, const struct joint_block *b, struct joint_scratch *s,
                                     size_t patch) {
    struct patch_sums sum = {0.0, 0.0};
    double expected = s->mean + s->offset[patch - b->first_patch];
    for (size_t i = f->patch[patch]; i < f->patch[patch + 1]; i++) {
        size_t k = i - b->first;
        double variance = variance_of(&f->point[i]), deviation = sqrt(variance);
        struct pull pull = pull_of(&f->point[i], (s->base[k] - expected) / deviation);
        s->weight[k] = pull.weight / variance;
        s->effective[k] =
            f->point[i].is_bound && pull.weight > 0.0 ? expected + deviation * pull.slope / pull.weight : s->base[k];
        sum.weight += s->weight[k];
        sum.base += s->weight[k] * s->effective[k];
    }
    s->stiffness[patch - b->first_patch] =
        t_weight(s->offset[patch - b->first_patch] / ALBEDO_PATCH) / square(ALBEDO_PATCH);
    return sum;
}

/* One round of reweighting: the mean with all offsets at their best, then the offsets. */
static void settle_round(const struct joint_fit *f, const struct joint_block *b, struct joint_scratch *s) {
    double prior = 1.0 / square(ALBEDO_DEVIATION), sum = prior * log(ALBEDO_MEAN), weights = prior;
    for (size_t p = b->first_patch; p < b->end_patch; p++) {
        struct patch_sums patch = weigh_patch(f, b, s, p);
        double stiffness = s->stiffness[p - b->first_patch];
        double weight = patch.weight * stiffness / (patch.weight + stiffness);
        sum += patch.weight > 0.0 ? weight * patch.base / patch.weight : 0.0;
        weights += weight;
    }
    s->mean = sum / weights;
    for (size_t p = b->first_patch; p < b->end_patch; p++) {
        struct patch_sums patch = {0.0, 0.0};
        for (size_t i = f->patch[p]; i < f->patch[p + 1]; i++) {
            patch.weight += s->weight[i - b->first];
            patch.base += s->weight[i - b->first] * (s->effective[i - b->first] - s->mean);
        }
        s->offset[p - b->first_patch] = patch.base / (patch.weight + s->stiffness[p - b->first_patch]);
    }
}

static double loss_of(const struct joint_fit *f, const struct joint_block *b, struct joint_scratch *s) {
    double loss = 0.5 * square((s->mean - log(ALBEDO_MEAN)) / ALBEDO_DEVIATION);
    for (size_t p = b->first_patch; p < b->end_patch; p++) {
        struct patch_sums patch = weigh_patch(f, b, s, p);
        double offset = s->offset[p - b->first_patch];
        loss += t_loss(offset / ALBEDO_PATCH);
        if (patch.weight > 0.0)
            loss += joint_white_bound(patch.base / patch.weight - f->source[0].value, 1.0 / patch.weight).loss;
        for (size_t i = f->patch[p]; i < f->patch[p + 1]; i++) {
            size_t k = i - b->first;
            double deviation = sqrt(variance_of(&f->point[i]));
            s->residual[k] = s->effective[k] - s->mean - offset;
            loss += pull_of(&f->point[i], (s->base[k] - s->mean - offset) / deviation).loss;
        }
    }
    return loss;
}

double joint_settle(const struct joint_fit *f, const struct joint_block *b, struct joint_scratch *s) {
    s->mean = median_of(f, b, s);
    for (size_t p = b->first_patch; p < b->end_patch; p++)
        s->offset[p - b->first_patch] = 0.0;
    for (int i = 0; i < SETTLE_ROUNDS; i++)
        settle_round(f, b, s);
    return loss_of(f, b, s);
}
