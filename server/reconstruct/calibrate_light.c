/* calibrate_light.c -- see calibrate_light.h.
 *
 * Iteratively reweighted least squares. With weights w, A the map from (G, v) to looks and M the
 * weighted mean over the looks of a point, what remains after the L are eliminated is
 *
 *     (A' W (I - M) A + prior) x = A' W (I - M) y,
 *
 * solved by preconditioned conjugate gradients: the matrix is never formed, so a capture of
 * thousands of photographs costs what its looks cost. Parameters that the model holds at none are
 * projected out of each step; the preconditioner is one number a frame, so it commutes with that. */
#include "server/reconstruct/calibrate_light.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "server/reconstruct/conjugate.h"
#include "server/reconstruct/overlap.h"

#define POINTS_PER_FRAME 60
#define POINTS_LEAST 4000
#define POINTS_MOST 24000
#define HELD_BACK_EVERY 4

/* Standard deviations, in logarithms: of a look at a flat, frontal place; that a grazing one adds
 * (times 1 / cosine - 1); of the priors on told exposures, white balance and vignette. */
#define LOOK_SIGMA 0.02
#define GRAZING_SIGMA 0.03
#define UNTOLD_SIGMA 3.0
#define DRIFT_SIGMA 0.2
#define COLOR_SIGMA 0.2
#define VIGNETTE_SIGMA 0.5

#define ROUNDS 12
#define CG_STEPS 60
#define CG_TOLERANCE 1e-7

/* A fault is taken up when it takes this share off the robust cost of the points held back, and
 * the gain stands this many standard errors above 0. Drift must be this large besides (rms, in
 * logarithms): what is glossy looks brighter in some photographs, which feigns 0.018 in the rooms
 * staircase2 and bathroom, where there is none. White balance and vignette are feigned by
 * nothing: 0.002 and 0.02 there. */
#define LEAST_GAIN 0.04
#define LEAST_SIGNIFICANCE 3.0
#define LEAST_DRIFT 0.025

enum { DRIFT = 1, COLOR = 2, VIGNETTE = 4, FAULTS = 8 };

struct fit {
    const struct overlaps *o;
    const struct views *views;
    size_t frames;                /* parameters are 3 a frame and 3 of the vignette */
    size_t untold_count;          /* frames whose exposure nobody told */
    bool *told;                   /* [frames] the exposure */
    double (*radius)[3];          /* [looks] s, s^2, s^3 */
    double *trust;                /* [looks] inverse variance by contrast and angle */
    double *weight;               /* [looks] trust made robust; 0: held back */
    double scale;                 /* residuals are this much larger than trust says */
    bool all_points;              /* nothing is held back */
};

static size_t parameter_count(const struct fit *f) {
    return 3 * f->frames + 3;
}

static bool held_back(const struct fit *f, size_t point) {
    return !f->all_points && point % HELD_BACK_EVERY == 0;
}

/* --- the linear system ------------------------------------------------------------------------ */

static double predict(const struct fit *f, const double *x, size_t look, int channel) {
    const double *v = x + 3 * f->frames, *s = f->radius[look];
    return x[3 * f->o->look[look].train + (size_t)channel] + v[0] * s[0] + v[1] * s[1] + v[2] * s[2];
}

/* out += A' W (I - M) z for the looks of one point and one channel, z[] by look of the point. */
static void scatter(const struct fit *f, size_t point, int channel, const double *z, double *out) {
    size_t first = f->o->start[point], count = f->o->start[point + 1] - first;
    double sum = 0.0, weight = 0.0;
    for (size_t i = 0; i < count; i++) {
        sum += f->weight[first + i] * z[i];
        weight += f->weight[first + i];
    }
    if (weight <= 0.0)
        return;
    double mean = sum / weight;
    for (size_t i = 0; i < count; i++) {
        double r = f->weight[first + i] * (z[i] - mean);
        out[3 * f->o->look[first + i].train + (size_t)channel] += r;
        for (size_t k = 0; k < 3; k++)
            out[3 * f->frames + k] += r * f->radius[first + i][k];
    }
}

/* Takes out of x what the model holds at none. */
static void project(const struct fit *f, int model, double *x) {
    for (size_t t = 0; t < f->frames; t++) {
        double *g = x + 3 * t, mean = (g[0] + g[1] + g[2]) / 3.0;
        double level = f->told[t] && !(model & DRIFT) ? 0.0 : mean;
        for (int c = 0; c < 3; c++)
            g[c] = level + (model & COLOR ? g[c] - mean : 0.0);
    }
    for (size_t k = 0; k < 3 && !(model & VIGNETTE); k++)
        x[3 * f->frames + k] = 0.0;
}

/* The linear system of a fit. */
struct light_system {
    const struct fit *fit;
    int model;
    double *inverse; /* [parameter_count] the preconditioner */
};

static void multiply(const void *user, const double *x, double *out) {
    const struct light_system *system = user;
    const struct fit *f = system->fit;
    for (size_t t = 0; t < f->frames; t++) {
        const double *g = x + 3 * t, mean = (g[0] + g[1] + g[2]) / 3.0;
        double sigma = f->told[t] ? DRIFT_SIGMA : UNTOLD_SIGMA;
        for (int c = 0; c < 3; c++)
            out[3 * t + (size_t)c] = mean / (sigma * sigma) + (g[c] - mean) / (COLOR_SIGMA * COLOR_SIGMA);
    }
    for (size_t k = 3 * f->frames; k < parameter_count(f); k++)
        out[k] = x[k] / (VIGNETTE_SIGMA * VIGNETTE_SIGMA);
    for (size_t p = 0; p < f->o->point_count; p++) {
        size_t first = f->o->start[p], count = f->o->start[p + 1] - first;
        for (int c = 0; c < 3 && !held_back(f, p); c++) {
            double z[OVERLAP_LOOKS_MAX];
            for (size_t i = 0; i < count; i++)
                z[i] = predict(f, x, first + i, c);
            scatter(f, p, c, z, out);
        }
    }
    project(f, system->model, out);
}

/* Sums of weights: one number a frame, one each coefficient of the vignette. */
static void make_preconditioner(const struct fit *f, double *inverse) {
    size_t n = parameter_count(f);
    for (size_t i = 0; i < n; i++)
        inverse[i] = 1.0;
    for (size_t p = 0; p < f->o->point_count; p++) {
        for (size_t i = f->o->start[p]; i < f->o->start[p + 1] && !held_back(f, p); i++) {
            for (size_t c = 0; c < 3; c++) {
                inverse[3 * f->o->look[i].train + c] += f->weight[i];
                inverse[3 * f->frames + c] += 3.0 * f->weight[i] * f->radius[i][c] * f->radius[i][c];
            }
        }
    }
    for (size_t i = 0; i < n; i++)
        inverse[i] = 1.0 / inverse[i];
}

static void precondition(const void *user, const double *residual, double *out) {
    const struct light_system *system = user;
    for (size_t i = 0; i < parameter_count(system->fit); i++)
        out[i] = system->inverse[i] * residual[i];
}

/* Improves x by conjugate gradients on the system with the present weights. */
static void solve_linear(const struct fit *f, int model, double *x) {
    size_t n = parameter_count(f);
    double *residual = mem_calloc(2 * n, sizeof *residual);
    struct light_system light = {f, model, residual + n};
    const struct conjugate_system system = {n, multiply, precondition, &light};
    make_preconditioner(f, light.inverse);
    for (size_t point = 0; point < f->o->point_count; point++) {
        size_t first = f->o->start[point], count = f->o->start[point + 1] - first;
        for (int c = 0; c < 3 && !held_back(f, point); c++) {
            double y[OVERLAP_LOOKS_MAX];
            for (size_t i = 0; i < count; i++)
                y[i] = (double)f->o->look[first + i].value[c];
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

/* Squared residuals of a point's looks over their expected variance, after the L that the weights
 * give; INFINITY where the photograph should show something too dark or too bright. [count]. */
static void point_residuals(const struct fit *f, const double *x, size_t point, const double *weight,
                            double *square) {
    size_t first = f->o->start[point], count = f->o->start[point + 1] - first;
    memset(square, 0, count * sizeof *square);
    for (int c = 0; c < 3; c++) {
        double y[OVERLAP_LOOKS_MAX], sum = 0.0, total = 1e-30;
        for (size_t i = 0; i < count; i++) {
            y[i] = (double)f->o->look[first + i].value[c] - predict(f, x, first + i, c);
            sum += weight[i] * y[i];
            total += weight[i];
        }
        double mean = sum / total;
        for (size_t i = 0; i < count; i++) {
            const struct look_at *look = &f->o->look[first + i];
            double shown = (double)look->value[c] - (y[i] - mean);
            bool usable = shown >= (double)look->least[c] && shown <= (double)look->most[c];
            square[i] += usable ? f->trust[first + i] * (y[i] - mean) * (y[i] - mean) / 3.0 : INFINITY;
        }
    }
}

static int compare_doubles(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* New weights and scale from the residuals; `gentle` weights do not give up on far ones. */
static void reweight(struct fit *f, const double *x, bool gentle) {
    size_t looks = f->o->start[f->o->point_count], used = 0;
    double *square = mem_array(looks + 1, sizeof *square), *sorted = mem_array(looks + 1, sizeof *sorted);
    for (size_t p = 0; p < f->o->point_count; p++) {
        size_t first = f->o->start[p], count = f->o->start[p + 1] - first;
        point_residuals(f, x, p, f->weight + first, square + first);
        for (size_t i = 0; i < count && !held_back(f, p); i++) {
            if (isfinite(square[first + i]))
                sorted[used++] = square[first + i];
        }
    }
    qsort(sorted, used, sizeof *sorted, compare_doubles);
    f->scale = used ? fmax(1.0, 1.48 * sqrt(sorted[used / 2])) : 1.0;
    for (size_t i = 0; i < looks; i++) {
        double e = square[i] / (f->scale * f->scale);
        double robust = gentle ? 1.0 / sqrt(1.0 + e) : 1.0 / (1.0 + 0.25 * e);
        f->weight[i] = f->trust[i] * robust / (f->scale * f->scale);
    }
    mem_free(sorted);
    mem_free(square);
}

/* Solves the model from x on. */
static void solve(struct fit *f, int model, double *x) {
    size_t looks = f->o->start[f->o->point_count];
    for (size_t i = 0; i < looks; i++)
        f->weight[i] = f->trust[i];
    for (int round = 0; round < ROUNDS; round++) {
        reweight(f, x, round < 4);
        solve_linear(f, model, x);
    }
}

/* Robust cost of each point that is held back, residuals in units of `scale`. Returns how many
 * there are. */
static size_t held_back_costs(const struct fit *f, const double *x, double scale, double *cost) {
    size_t used = 0;
    for (size_t p = 0; p < f->o->point_count; p++) {
        if (!held_back(f, p))
            continue;
        size_t first = f->o->start[p], count = f->o->start[p + 1] - first;
        double weight[OVERLAP_LOOKS_MAX], square[OVERLAP_LOOKS_MAX];
        memcpy(weight, f->trust + first, count * sizeof *weight);
        for (int round = 0; round < 6; round++) {
            point_residuals(f, x, p, weight, square);
            for (size_t i = 0; i < count; i++)
                weight[i] = f->trust[first + i] / (1.0 + 0.25 * square[i] / (scale * scale));
        }
        cost[used] = 0.0;
        for (size_t i = 0; i < count; i++)
            if (isfinite(square[i]))
                cost[used] += log1p(0.25 * square[i] / (scale * scale)) / (double)count;
        used++;
    }
    return used;
}

/* The share of the cost that `better` takes off `base`; 0 when that could be chance. */
static double gain_of(const double *base, const double *better, size_t count) {
    double sum = 0.0, squares = 0.0, total = 0.0;
    for (size_t i = 0; i < count; i++) {
        double d = base[i] - better[i];
        sum += d;
        squares += d * d;
        total += base[i];
    }
    double error = sqrt(fmax(squares - sum * sum / fmax((double)count, 1.0), 0.0));
    return sum > LEAST_SIGNIFICANCE * error && total > 0.0 ? sum / total : 0.0;
}

static double drift_of(const struct fit *f, const double *x) {
    double squares = 0.0;
    for (size_t t = 0; t < f->frames; t++) {
        double level = (x[3 * t] + x[3 * t + 1] + x[3 * t + 2]) / 3.0;
        squares += f->told[t] ? level * level : 0.0;
    }
    return sqrt(squares / fmax(1.0, (double)(f->frames - f->untold_count)));
}

/* Takes up faults one by one, the one that explains most first. Returns the model; x is its
 * solution. */
static int choose_model(struct fit *f, double *x) {
    size_t n = parameter_count(f), points = f->o->point_count / HELD_BACK_EVERY + 1, used;
    double *base = mem_array(points, sizeof *base), *cost = mem_array(points, sizeof *cost);
    double *trial = mem_array(n, sizeof *trial), *best = mem_array(n, sizeof *best);
    int model = 0;
    for (;;) {
        int taken = 0;
        double most = LEAST_GAIN, scale;
        solve(f, model, x);
        scale = f->scale;
        held_back_costs(f, x, scale, base);
        for (int fault = DRIFT; fault < FAULTS; fault *= 2) {
            if ((model & fault) || (fault == DRIFT && f->untold_count == f->frames))
                continue;
            memcpy(trial, x, n * sizeof *trial);
            solve(f, model | fault, trial);
            used = held_back_costs(f, trial, scale, cost);
            double gain = gain_of(base, cost, used);
            if (gain > most && (fault != DRIFT || drift_of(f, trial) > LEAST_DRIFT)) {
                most = gain;
                taken = fault;
                memcpy(best, trial, n * sizeof *best);
            }
        }
        if (taken == 0)
            break;
        model |= taken;
        memcpy(x, best, n * sizeof *x);
    }
    mem_free(best);
    mem_free(trial);
    mem_free(cost);
    mem_free(base);
    return model;
}

/* --- the whole -------------------------------------------------------------------------------- */

static void fit_init(struct fit *f, const struct views *views, const struct overlaps *o) {
    size_t looks = o->start[o->point_count];
    *f = (struct fit){.o = o, .views = views, .frames = views->train_count, .scale = 1.0};
    f->told = mem_calloc(f->frames + 1, sizeof *f->told);
    f->radius = mem_calloc(looks + 1, sizeof *f->radius);
    f->trust = mem_calloc(looks + 1, sizeof *f->trust);
    f->weight = mem_calloc(looks + 1, sizeof *f->weight);
    for (size_t t = 0; t < f->frames; t++) {
        f->told[t] = views->scene->photograph[views->train[t]].exposure_known;
        f->untold_count += !f->told[t];
    }
    for (size_t i = 0; i < looks; i++) {
        const struct look_at *look = &o->look[i];
        const struct photograph *photo = &views->scene->photograph[views->train[look->train]];
        double s = (double)photograph_radius(photo, look->x, look->y);
        double grazing = GRAZING_SIGMA * (1.0 / (double)look->cosine - 1.0);
        double contrast = (double)look->contrast;
        f->radius[i][0] = s;
        f->radius[i][1] = s * s;
        f->radius[i][2] = s * s * s;
        f->trust[i] = 1.0 / (LOOK_SIGMA * LOOK_SIGMA + grazing * grazing + 0.25 * contrast * contrast);
    }
}

static void fit_release(struct fit *f) {
    mem_free(f->told);
    mem_free(f->radius);
    mem_free(f->trust);
    mem_free(f->weight);
}

/* Root of the mean squared difference of looks from their point's mean. */
static double spread(const struct fit *f, const double *x) {
    double squares = 0.0, freedom = 0.0;
    for (size_t p = 0; p < f->o->point_count; p++) {
        size_t first = f->o->start[p], count = f->o->start[p + 1] - first;
        for (int c = 0; c < 3; c++) {
            double sum = 0.0, square = 0.0;
            for (size_t i = first; i < first + count; i++) {
                double y = (double)f->o->look[i].value[c] - predict(f, x, i, c);
                sum += y;
                square += y * y;
            }
            squares += square - sum * sum / (double)count;
            freedom += (double)count - 1.0;
        }
    }
    return freedom > 0.0 ? sqrt(squares / freedom) : 0.0;
}

/* Where nothing tells the mean level or the mean colour, it is 0. */
static void fix_gauge(const struct fit *f, int model, double *x) {
    double mean[3] = {0};
    for (size_t t = 0; t < f->frames; t++) {
        for (size_t c = 0; c < 3; c++)
            mean[c] += x[3 * t + c] / (double)f->frames;
    }
    double level = (mean[0] + mean[1] + mean[2]) / 3.0;
    bool level_free = f->untold_count == f->frames || (model & DRIFT);
    for (size_t t = 0; t < f->frames; t++) {
        for (size_t c = 0; c < 3; c++)
            x[3 * t + c] -= (level_free ? level : 0.0) + (model & COLOR ? mean[c] - level : 0.0);
    }
}

static void apply(const struct fit *f, int model, const double *x, struct scene *scene) {
    for (size_t t = 0; t < f->frames; t++) {
        struct photograph *photo = &scene->photograph[f->views->train[t]];
        const double *g = x + 3 * t;
        double level = f->told[t] ? 0.0 : (g[0] + g[1] + g[2]) / 3.0;
        photo->exposure *= (float)exp(level);
        if (model & (DRIFT | COLOR))
            photo->gain = rgb_mul(photo->gain, rgb_make((float)exp(g[0] - level), (float)exp(g[1] - level),
                                                        (float)exp(g[2] - level)));
    }
    for (size_t i = 0; i < scene->photograph_count && (model & VIGNETTE); i++) {
        for (size_t k = 0; k < 3; k++)
            scene->photograph[i].vignette[k] += (float)x[3 * f->frames + k];
    }
}

void calibrate_light(struct scene *scene, const struct views *views, const struct atlas *atlas,
                     const struct inverse_uv *inverse, bool faults, struct parallel *pool,
                     struct light_found *found) {
    struct overlaps overlaps;
    struct fit fit;
    size_t points = POINTS_PER_FRAME * views->train_count;
    points = points < POINTS_LEAST ? POINTS_LEAST : points > POINTS_MOST ? POINTS_MOST : points;
    overlaps_make(&overlaps, views, atlas, inverse, points, pool);
    fit_init(&fit, views, &overlaps);
    double *x = mem_calloc(parameter_count(&fit), sizeof *x);
    *found = (struct light_found){.exposures_solved = fit.untold_count, .spread_before = spread(&fit, x)};
    int model = faults ? choose_model(&fit, x) : 0;
    if (model != 0 || fit.untold_count > 0) {
        fit.all_points = true;
        solve(&fit, model, x);
    }
    fix_gauge(&fit, model, x);
    found->spread_after = spread(&fit, x);
    found->drift = (model & DRIFT) != 0;
    found->white_balance = (model & COLOR) != 0;
    found->vignette = (model & VIGNETTE) != 0;
    apply(&fit, model, x, scene);
    mem_free(x);
    fit_release(&fit);
    overlaps_release(&overlaps);
}
