/* light_fit.c -- see light_fit.h.
 *
 * Iteratively reweighted least squares. With weights w, A the map from (G, v, terms) to observations and M the weighted
 * mean over the observations of a point, eliminating the L leaves
 *
 *      (A' W (I - M) A + prior) x = A' W (I - M) y,
 *
 * solved by preconditioned conjugate gradients: the matrix is never formed, so time grows linearly with the number of
 * observations. Parameters outside the model are projected out of each step; the preconditioner has one number a frame,
 * so it commutes with the projection.
 *
 * A curve that pressed all observations of a point together would make them agree. So the cost by which they are judged
 * is that of the stored values, F's argument, and the basis is taken where the others of the point foretell the
 * value. */
#include "server/capture/light_fit.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "server/capture/conjugate.h"

/* Standard deviations, in logarithms: of an observation of a flat, frontal surface; added at grazing angles (times 1 /
 * cosine - 1); of the priors on unknown exposures (twenty-fold either way), drift of given ones, white balance (20 %,
 * as automatic ones step) and vignette coefficients (a factor of .6 or 1.6 at radius 1). The cost has hundreds of
 * observations a frame against one prior: a prior only decides for frames with next to none. */
#define OBSERVATION_SIGMA 0.02     /* +25 %: no change */
#define GRAZING_SIGMA 0.03         /* +25 %: no change */
#define UNKNOWN_EXPOSURE_SIGMA 3.0 /* +25 %: no change */
#define DRIFT_SIGMA 0.2            /* +25 %: no change */
#define COLOR_SIGMA 0.2            /* +25 %: no change */
#define VIGNETTE_SIGMA 0.5         /* +25 %: no change */
/* Of the power of a tone curve, and of each term of its shape. An S of .6 of smoothstep has .28; .05, .03, 0. Frames of
 * a few exposures far apart leave a shape open that repeats from one to the next (Grossberg and Nayar 2003): the prior
 * of shapes is as strong as if all observations of a photograph, which share errors, were one. */
#define TONE_POWER_SIGMA 0.3
#define TONE_SHAPE_SIGMA 0.1

#define MAX_HALVINGS 10 /* of a step to a curve that does not rise */

/* Rounds of reweighting, and the first of them, whose weights are those of a convex cost: it has one minimum, and the
 * others start near it. */
#define ROUNDS 12         /* +25 %: no change */
#define CONVEX_ROUNDS 4   /* +25 %: no change */
#define CG_STEPS 60       /* of conjugate gradients a round, at most */
#define CG_TOLERANCE 1e-7 /* of the residual's norm, over that of the right-hand side */

/* No curve. */
static void forget_bend(struct light_fit *f) { memset(f->bend, 0, f->o->start[f->o->point_count] * sizeof *f->bend); }

void light_fit_init(struct light_fit *f, const struct views *views, const struct overlaps *o) {
    size_t observations = o->start[o->point_count];
    *f = (struct light_fit){.o = o, .views = views, .frames = views->train_count, .scale = 1.0};
    f->exposure_known = mem_calloc(f->frames + 1, sizeof *f->exposure_known);
    f->radius = mem_calloc(observations + 1, sizeof *f->radius);
    f->prior_weight = mem_calloc(observations + 1, sizeof *f->prior_weight);
    f->weight = mem_calloc(observations + 1, sizeof *f->weight);
    f->bend = mem_array(observations + 1, sizeof *f->bend);
    f->usable = mem_calloc(observations + 1, sizeof *f->usable);
    f->may_bend = true;
    tone_table_init(&f->tones);
    forget_bend(f);
    for (size_t t = 0; t < f->frames; t++) {
        f->exposure_known[t] = views->scene->photograph[views->train[t]].exposure_known;
        f->unknown_exposure_count += !f->exposure_known[t];
        f->may_bend = f->may_bend && !views->scene->photograph[views->train[t]].is_hdr &&
                      !views->scene->photograph[views->train[t]].is_straight;
    }
    for (size_t i = 0; i < observations; i++) {
        const struct overlap_observation *observation = &o->observation[i];
        const struct photograph *photo = &views->scene->photograph[views->train[observation->train]];
        double s = (double)photograph_radius(photo, observation->x, observation->y);
        double grazing = GRAZING_SIGMA * (1.0 / (double)observation->cosine - 1.0);
        double contrast = (double)observation->contrast;
        f->radius[i][0] = s;
        f->radius[i][1] = s * s;
        f->radius[i][2] = s * s * s;
        f->prior_weight[i] =
            1.0 / (OBSERVATION_SIGMA * OBSERVATION_SIGMA + grazing * grazing + 0.25 * contrast * contrast);
    }
}

void light_fit_release(struct light_fit *f) {
    mem_free(f->exposure_known);
    mem_free(f->radius);
    mem_free(f->prior_weight);
    mem_free(f->weight);
    mem_free(f->bend);
    mem_free(f->usable);
}

/* --- the linear system ------------------------------------------------------------------------ */

double light_fit_predict(const struct light_fit *f, const double *x, size_t observation, int channel) {
    const double *v = x + 3 * f->frames, *s = f->radius[observation];
    return x[3 * f->o->observation[observation].train + (size_t)channel] + v[0] * s[0] + v[1] * s[1] + v[2] * s[2];
}

double light_fit_value(const struct light_fit *f, size_t observation, int channel) {
    return (double)f->o->observation[observation].value[channel] + (double)f->bend[observation].added[channel];
}

static size_t first_term(const struct light_fit *f) { return 3 * f->frames + 3; }

/* The curve's part in the equations: what its terms x change the straightened value by. */
static double bent_by(const struct light_fit *f, const double *x, size_t observation, int channel) {
    const double *term = x + first_term(f);
    const float *basis = f->bend[observation].basis[channel];
    double sum = 0.0;
    for (size_t k = 0; k < TONE_TERMS; k++)
        sum += term[k] * (double)basis[k];
    return sum;
}

/* out += A' W (I - M) z for one point and channel; z[] by observation of the point. */
static void scatter(const struct light_fit *f, size_t point, int channel, const double *z, double *out) {
    size_t first = f->o->start[point], count = f->o->start[point + 1] - first;
    double sum = 0.0, weight = 0.0;
    for (size_t i = 0; i < count; i++) {
        sum += f->weight[first + i] * z[i];
        weight += f->weight[first + i];
    }
    if (weight <= 0.0)
        return;
    double mean = sum / weight, *term = out + first_term(f);
    for (size_t i = 0; i < count; i++) {
        double r = f->weight[first + i] * (z[i] - mean);
        for (size_t k = 0; k < TONE_TERMS; k++)
            term[k] -= r * (double)f->bend[first + i].basis[channel][k];
        out[3 * f->o->observation[first + i].train + (size_t)channel] += r;
        for (size_t k = 0; k < 3; k++)
            out[3 * f->frames + k] += r * f->radius[first + i][k];
    }
}

/* Sets steps of parameters outside the model to 0. */
static void project(const struct light_fit *f, int model, double *x) {
    for (size_t t = 0; t < f->frames; t++) {
        double *g = x + 3 * t, mean = (g[0] + g[1] + g[2]) / 3.0;
        double level = f->exposure_known[t] && !(model & LIGHT_DRIFT) ? 0.0 : mean;
        for (int c = 0; c < 3; c++)
            g[c] = level + (model & LIGHT_COLOR ? g[c] - mean : 0.0);
    }
    for (size_t k = 0; k < 3 && !(model & LIGHT_VIGNETTE); k++)
        x[3 * f->frames + k] = 0.0;
    for (size_t k = 0; k < TONE_TERMS; k++) {
        if (!(model & LIGHT_TONES) || (k == TONE_POWER && light_fit_is_power_open(f, model)))
            x[first_term(f) + k] = 0.0;
    }
}

/* The linear system of a fit. */
struct light_system {
    const struct light_fit *fit;
    int model;
    double *inverse; /* [parameter_count] the preconditioner */
};

static void multiply(const void *user, const double *x, double *out) {
    const struct light_system *system = user;
    const struct light_fit *f = system->fit;
    for (size_t t = 0; t < f->frames; t++) {
        const double *g = x + 3 * t, mean = (g[0] + g[1] + g[2]) / 3.0;
        double sigma = f->exposure_known[t] ? DRIFT_SIGMA : UNKNOWN_EXPOSURE_SIGMA;
        for (int c = 0; c < 3; c++)
            out[3 * t + (size_t)c] = mean / (sigma * sigma) + (g[c] - mean) / (COLOR_SIGMA * COLOR_SIGMA);
    }
    for (size_t k = 3 * f->frames; k < 3 * f->frames + 3; k++)
        out[k] = x[k] / (VIGNETTE_SIGMA * VIGNETTE_SIGMA);
    for (size_t k = 0; k < TONE_TERMS; k++) {
        double a_frame = (double)f->o->start[f->o->point_count] / (double)f->frames;
        double weight = k == TONE_POWER ? 1.0 / (TONE_POWER_SIGMA * TONE_POWER_SIGMA)
                                        : a_frame / (TONE_SHAPE_SIGMA * TONE_SHAPE_SIGMA);
        out[first_term(f) + k] = weight * x[first_term(f) + k];
    }
    for (size_t p = 0; p < f->o->point_count; p++) {
        size_t first = f->o->start[p], count = f->o->start[p + 1] - first;
        for (int c = 0; c < 3 && !light_fit_is_held_out(f, p); c++) {
            double z[OVERLAP_OBSERVATIONS_MAX];
            for (size_t i = 0; i < count; i++)
                z[i] = light_fit_predict(f, x, first + i, c) - bent_by(f, x, first + i, c);
            scatter(f, p, c, z, out);
        }
    }
    project(f, system->model, out);
}

/* Jacobi preconditioner: sums of weights, one number a frame and one for each coefficient of vignette and curve. */
static void make_preconditioner(const struct light_fit *f, double *inverse) {
    size_t n = light_fit_parameter_count(f);
    for (size_t i = 0; i < n; i++)
        inverse[i] = 1.0;
    for (size_t p = 0; p < f->o->point_count; p++) {
        for (size_t i = f->o->start[p]; i < f->o->start[p + 1] && !light_fit_is_held_out(f, p); i++) {
            for (size_t c = 0; c < 3; c++) {
                inverse[3 * f->o->observation[i].train + c] += f->weight[i];
                inverse[3 * f->frames + c] += 3.0 * f->weight[i] * f->radius[i][c] * f->radius[i][c];
                for (size_t k = 0; k < TONE_TERMS; k++) {
                    double basis = (double)f->bend[i].basis[c][k];
                    inverse[first_term(f) + k] += f->weight[i] * basis * basis;
                }
            }
        }
    }
    for (size_t i = 0; i < n; i++)
        inverse[i] = 1.0 / inverse[i];
}

static void precondition(const void *user, const double *residual, double *out) {
    const struct light_system *system = user;
    for (size_t i = 0; i < light_fit_parameter_count(system->fit); i++)
        out[i] = system->inverse[i] * residual[i];
}

/* Improves x by conjugate gradients on the system with the present weights. */
static void solve_linear(const struct light_fit *f, int model, double *x) {
    size_t n = light_fit_parameter_count(f);
    double *residual = mem_calloc(2 * n, sizeof *residual);
    struct light_system light = {f, model, residual + n};
    const struct conjugate_system system = {n, multiply, precondition, &light};
    make_preconditioner(f, light.inverse);
    for (size_t point = 0; point < f->o->point_count; point++) {
        size_t first = f->o->start[point], count = f->o->start[point + 1] - first;
        for (int c = 0; c < 3 && !light_fit_is_held_out(f, point); c++) {
            double y[OVERLAP_OBSERVATIONS_MAX];
            for (size_t i = 0; i < count; i++)
                y[i] = light_fit_value(f, first + i, c) - bent_by(f, x, first + i, c);
            scatter(f, point, c, y, residual);
        }
    }
    project(f, model, residual);
    double goal = CG_TOLERANCE * CG_TOLERANCE * conjugate_dot(residual, residual, n);
    conjugate_residual(&system, x, residual);
    conjugate_solve(&system, CG_STEPS, goal, residual, x);
    mem_free(residual);
}

/* --- robustness --------------------------------------------------------------------------------- */

/* What straightened observations of a point are off by, from the mean by these weights; NAN where all of them are 0.
 * Both arrays [observations of the point]. */
static void find_errors(const struct light_fit *f, const double *x, size_t point, int channel, const double *weight,
                        double *off) {
    size_t first = f->o->start[point], count = f->o->start[point + 1] - first;
    double sum = 0.0, total = 0.0;
    for (size_t i = 0; i < count; i++) {
        off[i] = light_fit_value(f, first + i, channel) - light_fit_predict(f, x, first + i, channel);
        sum += weight[i] * off[i];
        total += weight[i];
    }
    for (size_t i = 0; i < count; i++)
        off[i] = total > 0.0 ? off[i] - sum / total : NAN;
}

/* Log of the stored value that would agree with the others of its point; its own where there are none. */
static double foretell(const struct light_fit *f, size_t observation, int channel, double off) {
    double level = (double)f->o->observation[observation].level[channel];
    return isnan(off) ? level : tone_stored(&f->tones, tone_straight(&f->tones, level) - off);
}

bool light_fit_bend(struct light_fit *f, const double *x) {
    struct tone_curve curve;
    memcpy(curve.term, x + first_term(f), sizeof curve.term);
    if (!tone_table_set(&f->tones, &curve))
        return false;
    for (size_t p = 0; p < f->o->point_count; p++) {
        size_t first = f->o->start[p], count = f->o->start[p + 1] - first;
        for (int c = 0; c < 3; c++) {
            double off[OVERLAP_OBSERVATIONS_MAX], basis[TONE_TERMS];
            for (size_t i = first; i < first + count; i++) {
                double level = (double)f->o->observation[i].level[c];
                f->bend[i].added[c] = (float)(tone_straight(&f->tones, level) - level);
            }
            find_errors(f, x, p, c, f->weight + first, off);
            for (size_t i = 0; i < count; i++) {
                struct light_bend *bend = &f->bend[first + i];
                double foretold = foretell(f, first + i, c, off[i]);
                tone_basis(&f->tones, foretold, basis);
                for (size_t k = 0; k < TONE_TERMS; k++)
                    bend->basis[c][k] = (float)basis[k];
            }
        }
    }
    return true;
}

void light_fit_residuals(const struct light_fit *f, int model, const double *x, size_t point, const double *weight,
                         double *square) {
    size_t first = f->o->start[point], count = f->o->start[point + 1] - first;
    memset(square, 0, count * sizeof *square);
    for (int c = 0; c < 3; c++) {
        double off[OVERLAP_OBSERVATIONS_MAX];
        find_errors(f, x, point, c, weight, off);
        for (size_t i = 0; i < count; i++) {
            const struct overlap_observation *observation = &f->o->observation[first + i];
            double error = off[i], predicted = (double)observation->value[c] - off[i];
            bool usable =
                predicted >= (double)observation->min_value[c] && predicted <= (double)observation->max_value[c];
            if (model & LIGHT_TONES) {
                usable = !isnan(off[i]) && (f->usable[first + i] >> c & 1);
                error = (double)observation->level[c] - foretell(f, first + i, c, off[i]);
            } else {
                f->usable[first + i] = (uint8_t)((f->usable[first + i] & ~(1 << c)) | usable << c);
            }
            square[i] += usable ? f->prior_weight[first + i] * error * error / 3.0 : INFINITY;
        }
    }
}

/* New weights and scale from the residuals. Convex weights (first rounds) keep some pull from far observations; the
 * later ones redescend (Cauchy). */
static void reweight(struct light_fit *f, int model, const double *x, bool is_convex) {
    size_t observations = f->o->start[f->o->point_count], used = 0;
    double *square = mem_array(observations + 1, sizeof *square), *known = mem_array(observations + 1, sizeof *known);
    for (size_t p = 0; p < f->o->point_count; p++) {
        size_t first = f->o->start[p], count = f->o->start[p + 1] - first;
        light_fit_residuals(f, model, x, p, f->weight + first, square + first);
        for (size_t i = 0; i < count && !light_fit_is_held_out(f, p); i++) {
            if (isfinite(square[first + i]))
                known[used++] = square[first + i];
        }
    }
    f->scale = fmax(1.0, QUANTILE_DEVIATIONS_PER_MAD * sqrt(quantile_double(known, used, 0.5)));
    for (size_t i = 0; i < observations; i++) {
        double e = square[i] / (f->scale * f->scale);
        double robust = is_convex ? 1.0 / sqrt(1.0 + e) : 1.0 / (1.0 + LIGHT_CAUCHY * e);
        f->weight[i] = f->prior_weight[i] * robust / (f->scale * f->scale);
    }
    mem_free(known);
    mem_free(square);
}

void light_fit_solve(struct light_fit *f, int model, double *x) {
    size_t observations = f->o->start[f->o->point_count];
    for (size_t i = 0; i < observations; i++)
        f->weight[i] = f->prior_weight[i];
    forget_bend(f);
    if (model & LIGHT_TONES)
        light_fit_bend(f, x);
    for (int round = 0; round < ROUNDS; round++) {
        double before[TONE_TERMS], *term = x + first_term(f);
        memcpy(before, term, sizeof before);
        reweight(f, model, x, round < CONVEX_ROUNDS);
        solve_linear(f, model, x);
        for (int halvings = 0; (model & LIGHT_TONES) && !light_fit_bend(f, x); halvings++) {
            for (size_t k = 0; k < TONE_TERMS; k++)
                term[k] = halvings < MAX_HALVINGS ? 0.5 * (term[k] + before[k]) : before[k];
        }
    }
}
