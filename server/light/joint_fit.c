/* joint_fit.c -- see joint_fit.h. */
#include "server/light/joint_fit.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "common/cholesky.h"
#include "common/mem.h"
#include "server/light/joint_model.h"

#define CHUNKS 16        /* parts of the blocks that are summed apart, so that sums do not depend on threads */
#define STEPS 30         /* at most; from priors some 10 to 20 are made */
#define LONGEST_STEP 1.0 /* of a theta */
#define HALVINGS 6       /* of a step that does not lower the loss */
#define CONVERGED 1e-3   /* nats by which a step lowers the loss at the end */
#define MIN_SHARE 1e-5f  /* parts of a point's light below it do not count */

static double square(double x) { return x * x; }

/* --- the problem ------------------------------------------------------------------------------------------- */

static void find_blocks(struct joint_fit *f) {
    const struct joint_point *p = f->point;
    f->block = mem_array(f->point_count + 1, sizeof *f->block);
    f->patch = mem_array(f->point_count + 1, sizeof *f->patch);
    for (size_t i = 0; i < f->point_count; i++) {
        bool new_block = i == 0 || p[i].segment != p[i - 1].segment;
        if (new_block)
            f->block[f->block_count++] = (struct joint_block){.first = i, .first_patch = f->patch_count};
        if (new_block || p[i].patch != p[i - 1].patch)
            f->patch[f->patch_count++] = i;
        f->block[f->block_count - 1].end = i + 1;
        f->block[f->block_count - 1].end_patch = f->patch_count;
    }
    f->patch[f->patch_count] = f->point_count;
}

void joint_fit_init(struct joint_fit *f, const struct joint_point *point, size_t point_count, size_t source_max,
                    struct parallel *pool) {
    *f = (struct joint_fit){.pool = pool, .point = point, .point_count = point_count, .source_max = source_max};
    f->response = mem_calloc_large(point_count * source_max + 1, sizeof *f->response);
    f->source = mem_array(source_max + 1, sizeof *f->source);
    f->source[f->source_count++] = (struct joint_source){
        .mean = log(ALBEDO_WHITE), .deviation = ALBEDO_WHITE_DEVIATION, .least = -INFINITY, .value = log(ALBEDO_WHITE)};
    find_blocks(f);
}

void joint_fit_release(struct joint_fit *f) {
    mem_free(f->patch);
    mem_free(f->block);
    mem_free(f->source);
    mem_free(f->response);
    *f = (struct joint_fit){0};
}

void joint_fit_add(struct joint_fit *f, const struct joint_source *source, const float *column) {
    assert(f->source_count < f->source_max);
    for (size_t i = 0; i < f->point_count; i++)
        f->response[i * f->source_max + f->source_count] = column[i];
    f->source[f->source_count++] = *source;
}

void joint_fit_remove_last(struct joint_fit *f) { f->source_count--; }

/* --- loss and its derivatives ------------------------------------------------------------------------------ */

struct joint_chunk {
    double loss;
    double *slope;     /* [source_count] gradient by theta; NULL: only the loss is asked for; owned, as below */
    double *curvature; /* [source_count][source_count] lower triangle */
};

struct assembly {
    const struct joint_fit *f;
    double *x; /* [source_count] */
    struct joint_chunk chunk[CHUNKS];
};

/* The sources that matter at a point, and their shares of its light. */
struct shares {
    size_t count;
    uint32_t *source;
    double *share;
};

static void find_shares(const struct joint_fit *f, size_t point, const double *x, struct shares *s) {
    const float *row = f->response + point * f->source_max;
    double light = joint_fit_light(f, point, x);
    s->count = 0;
    for (size_t j = 0; j < f->source_count; j++) {
        double share = (double)row[j] * x[j] / light;
        if (share > (double)MIN_SHARE) {
            s->source[s->count] = (uint32_t)j;
            s->share[s->count++] = share;
        }
    }
}

/* matrix += weight v v^T, lower triangle. */
static void add_square(double *matrix, size_t n, const double *v, double weight) {
    for (size_t a = 0; a < n; a++) {
        double row = weight * v[a];
        for (size_t b = 0; b <= a && row != 0.0; b++)
            matrix[a * n + b] += row * v[b];
    }
}

/* Scratch of one chunk. */
struct derivative {
    struct shares shares;
    double *patch; /* [source_count] weighted sum of the points' shares */
    double *block; /* [source_count] the same of patches, with their offsets eliminated */
};

/* Adds the points of a patch; returns the sum of their weights. */
static double add_patch_points(const struct assembly *a, struct joint_chunk *c, const struct joint_block *b,
                               const struct joint_scratch *s, struct derivative *d, size_t patch) {
    const struct joint_fit *f = a->f;
    size_t n = f->source_count;
    double weights = 0.0;
    memset(d->patch, 0, n * sizeof *d->patch);
    for (size_t i = f->patch[patch]; i < f->patch[patch + 1]; i++) {
        double weight = s->weight[i - b->first], pull = weight * s->residual[i - b->first];
        find_shares(f, i, a->x, &d->shares);
        weights += weight;
        for (size_t k = 0; k < d->shares.count; k++) {
            size_t j = d->shares.source[k];
            double share = d->shares.share[k];
            c->slope[j] -= pull * share;
            d->patch[j] += weight * share;
            for (size_t m = 0; m <= k; m++)
                c->curvature[j * n + d->shares.source[m]] += weight * share * d->shares.share[m];
        }
    }
    return weights;
}

/* The patch's mean is bounded by white paint; its offset is eliminated. */
static void add_patch(const struct assembly *a, struct joint_chunk *c, const struct joint_block *b,
                      const struct joint_scratch *s, struct derivative *d, size_t patch, double *block_weight) {
    const struct joint_fit *f = a->f;
    size_t n = f->source_count;
    double base = 0.0, weights = add_patch_points(a, c, b, s, d, patch);
    double stiffness = s->stiffness[patch - b->first_patch];
    if (!(weights > 0.0))
        return;
    for (size_t i = f->patch[patch]; i < f->patch[patch + 1]; i++)
        base += s->weight[i - b->first] * s->effective[i - b->first] / weights;
    struct joint_white_bound white = joint_white_bound(base - f->source[0].value, 1.0 / weights);
    for (size_t j = 0; j < n; j++) {
        c->slope[j] -= white.slope * d->patch[j] / weights;
        d->block[j] += d->patch[j] * stiffness / (weights + stiffness);
    }
    add_square(c->curvature, n, d->patch, -1.0 / (weights + stiffness));
    d->patch[0] = weights; /* the loss of the bound falls with white paint as with light */
    add_square(c->curvature, n, d->patch, white.curvature / square(weights));
    c->slope[0] -= white.slope;
    *block_weight += weights * stiffness / (weights + stiffness);
}

static void add_block(const struct assembly *a, struct joint_chunk *c, const struct joint_block *b,
                      struct joint_scratch *s, struct derivative *d) {
    const struct joint_fit *f = a->f;
    joint_find_base(f, b, a->x, s);
    c->loss += joint_settle(f, b, s);
    if (!c->slope)
        return;
    double weight = 0.0;
    memset(d->block, 0, f->source_count * sizeof *d->block);
    for (size_t p = b->first_patch; p < b->end_patch; p++)
        add_patch(a, c, b, s, d, p, &weight);
    add_square(c->curvature, f->source_count, d->block, -1.0 / (weight + 1.0 / square(ALBEDO_DEVIATION)));
}

static void add_chunk(void *user, size_t index, int thread) {
    (void)thread;
    struct assembly *a = user;
    const struct joint_fit *f = a->f;
    struct joint_scratch s;
    struct derivative d;
    joint_scratch_init(&s, f);
    d.shares.source = mem_array(f->source_count + 1, sizeof *d.shares.source);
    d.shares.share = mem_array(f->source_count + 1, sizeof *d.shares.share);
    d.patch = mem_array(f->source_count + 1, sizeof *d.patch);
    d.block = mem_array(f->source_count + 1, sizeof *d.block);
    for (size_t k = 0; k < f->block_count; k++) {
        if (f->block[k].first * CHUNKS / f->point_count == index)
            add_block(a, &a->chunk[index], &f->block[k], &s, &d);
    }
    mem_free(d.block);
    mem_free(d.patch);
    mem_free(d.shares.share);
    mem_free(d.shares.source);
    joint_scratch_release(&s);
}

/* Adds (theta[a] - theta[b] - difference)^2 / (2 deviation^2); without b where it is not below the count. */
static double add_prior(const struct joint_fit *f, struct joint_chunk *c, size_t a, size_t b, double difference,
                        double deviation) {
    size_t n = f->source_count;
    double off = f->source[a].value - (b < n ? f->source[b].value : 0.0) - difference, weight = 1.0 / square(deviation);
    if (c->slope) {
        c->slope[a] += weight * off;
        c->curvature[a * n + a] += weight;
    }
    if (c->slope && b < n) {
        c->slope[b] -= weight * off;
        c->curvature[b * n + b] += weight;
        c->curvature[(a > b ? a : b) * n + (a > b ? b : a)] -= weight;
    }
    return 0.5 * weight * off * off;
}

/* Loss at the sources' values, and, into slope[] and curvature[] unless they are NULL, its derivatives. */
static double assemble(const struct joint_fit *f, double *slope, double *curvature) {
    size_t n = f->source_count;
    struct assembly a = {.f = f, .x = joint_fit_radiances(f)};
    struct joint_chunk sum = {0.0, slope, curvature};
    for (size_t k = 0; k < CHUNKS && slope; k++) {
        a.chunk[k].slope = mem_calloc(n + 1, sizeof *slope);
        a.chunk[k].curvature = mem_calloc(n * n + 1, sizeof *curvature);
    }
    if (f->point_count > 0)
        parallel_for(f->pool, CHUNKS, add_chunk, &a);
    for (size_t k = 0; k < CHUNKS; k++) {
        sum.loss += a.chunk[k].loss;
        for (size_t i = 0; i < n && slope; i++)
            slope[i] += a.chunk[k].slope[i];
        for (size_t i = 0; i < n * n && slope; i++)
            curvature[i] += a.chunk[k].curvature[i];
        mem_free(a.chunk[k].slope);
        mem_free(a.chunk[k].curvature);
    }
    for (size_t j = 0; j < n; j++)
        sum.loss += add_prior(f, &sum, j, n, f->source[j].mean, f->source[j].deviation);
    for (size_t t = 0; t < f->tie_count; t++)
        sum.loss += add_prior(f, &sum, f->tie[t].a, f->tie[t].b, f->tie[t].difference, f->tie[t].deviation);
    mem_free(a.x);
    return sum.loss;
}

double joint_fit_loss(const struct joint_fit *f) { return assemble(f, NULL, NULL); }

/* --- the fit ----------------------------------------------------------------------------------------------- */

/* Takes the sources out of a system that are at their bounds and are drawn below them. */
static void hold_at_bounds(const struct joint_fit *f, double *slope, double *curvature) {
    size_t n = f->source_count;
    for (size_t j = 0; j < n; j++) {
        if (!(f->source[j].value <= f->source[j].least && slope[j] >= 0.0))
            continue;
        slope[j] = 0.0;
        for (size_t k = 0; k < n; k++)
            curvature[j > k ? j * n + k : k * n + j] = j == k ? 1.0 : 0.0;
    }
}

/* Moves by the step, or by a half of it and so on; returns the new loss, or the old one where none is lower. */
static double move(struct joint_fit *f, const double *step, double loss) {
    double *before = mem_array(f->source_count + 1, sizeof *before), length = 1.0;
    for (size_t j = 0; j < f->source_count; j++)
        before[j] = f->source[j].value;
    for (int i = 0; i <= HALVINGS; i++, length *= 0.5) {
        for (size_t j = 0; j < f->source_count; j++) {
            double by = fmin(fmax(length * step[j], -LONGEST_STEP), LONGEST_STEP);
            f->source[j].value = fmax(before[j] - by, f->source[j].least);
        }
        double here = joint_fit_loss(f);
        if (here < loss) {
            mem_free(before);
            return here;
        }
    }
    for (size_t j = 0; j < f->source_count; j++)
        f->source[j].value = before[j];
    mem_free(before);
    return loss;
}

double joint_fit_solve(struct joint_fit *f) {
    size_t n = f->source_count;
    double *slope = mem_array(n + 1, sizeof *slope), *curvature = mem_array(n * n + 1, sizeof *curvature);
    double loss = INFINITY;
    for (int i = 0; i < STEPS; i++) {
        memset(slope, 0, n * sizeof *slope);
        memset(curvature, 0, n * n * sizeof *curvature);
        loss = assemble(f, slope, curvature);
        hold_at_bounds(f, slope, curvature);
        if (!cholesky_factor(n, n, curvature))
            break;
        cholesky_solve(n, n, curvature, slope);
        double here = move(f, slope, loss);
        bool is_done = !(here < loss - CONVERGED);
        loss = here;
        if (is_done)
            break;
    }
    mem_free(curvature);
    mem_free(slope);
    return loss;
}

/* Shares of the sources in the light of a point, the means of all points. */
static void find_mean_shares(struct joint_fit *f) {
    double *x = joint_fit_radiances(f);
    for (size_t j = 0; j < f->source_count; j++)
        f->source[j].share = 0.0;
    double count = 0.0;
    for (size_t i = 0; i < f->point_count; i++)
        count += f->point[i].is_lamp ? 0.0 : 1.0;
    for (size_t i = 0; i < f->point_count; i++) {
        const float *row = f->response + i * f->source_max;
        double light = joint_fit_light(f, i, x) * count;
        for (size_t j = 0; j < f->source_count && !f->point[i].is_lamp; j++)
            f->source[j].share += (double)row[j] * x[j] / light;
    }
    mem_free(x);
}

void joint_fit_errors(struct joint_fit *f) {
    size_t n = f->source_count;
    double *slope = mem_calloc(n + 1, sizeof *slope), *curvature = mem_calloc(n * n + 1, sizeof *curvature);
    double *column = mem_array(n + 1, sizeof *column);
    assemble(f, slope, curvature);
    bool is_positive = cholesky_factor(n, n, curvature);
    double variance = 0.0;
    find_mean_shares(f);
    for (size_t j = 0; j < n; j++) {
        memset(column, 0, n * sizeof *column);
        column[j] = is_positive ? 1.0 : square(f->source[j].deviation); /* of the priors' covariance */
        if (is_positive)
            cholesky_solve(n, n, curvature, column);
        f->source[j].error = sqrt(fmax(column[j], 0.0));
        for (size_t k = 0; k < n; k++)
            variance += f->source[j].share * column[k] * f->source[k].share;
    }
    f->light_error = sqrt(fmax(variance, 0.0));
    mem_free(column);
    mem_free(curvature);
    mem_free(slope);
}
