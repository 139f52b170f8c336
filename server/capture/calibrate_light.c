/* calibrate_light.c -- see calibrate_light.h: model selection and its application. */
#include "server/capture/calibrate_light.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/capture/light_fit.h"
#include "server/capture/overlap.h"
#include "server/capture/validation.h"

/* Surface points compared: their number a photograph, twenty for each unknown (exposure and two of white balance);
 * bounds of all, below for captures of few photographs, above for time and memory. */
#define POINTS_PER_FRAME 60 /* +25 %: no change */
#define POINTS_MIN 4000     /* +25 %: no change */
#define POINTS_MAX 24000    /* +25 %: no change */

#define COST_ROUNDS 6 /* of reweighting for the robust mean of a held-out point, which has converged; to 7: no change */

/* A fault is accepted when it lowers the robust cost of held-out points by this share, and the gain is this many
 * standard errors above 0. Drift must also have this rms (in logarithms): glossy surfaces look brighter in some
 * photographs, which imitates a drift of 0.018 in staircase2 and bathroom, where there is none. Nothing imitates white
 * balance or a vignette there: 0.002 and 0.02. */
#define MIN_GAIN 0.04        /* +25 %: no change */
#define MIN_SIGNIFICANCE 3.0 /* +25 %: no change */
#define MIN_DRIFT 0.025      /* +25 %: no change */

/* --- model selection --------------------------------------------------------------------------- */

/* Robust cost of each held-out point, with residuals in units of `scale`. Returns their number. */
static size_t held_out_costs(const struct light_fit *f, int model, const double *x, double scale, double *cost) {
    size_t used = 0;
    for (size_t p = 0; p < f->o->point_count; p++) {
        if (!light_fit_is_held_out(f, p))
            continue;
        size_t first = f->o->start[p], count = f->o->start[p + 1] - first;
        double weight[OVERLAP_OBSERVATIONS_MAX], square[OVERLAP_OBSERVATIONS_MAX];
        memcpy(weight, f->prior_weight + first, count * sizeof *weight);
        for (int round = 0; round < COST_ROUNDS; round++) {
            light_fit_residuals(f, model, x, p, weight, square);
            for (size_t i = 0; i < count; i++)
                weight[i] = f->prior_weight[first + i] / (1.0 + LIGHT_CAUCHY * square[i] / (scale * scale));
        }
        cost[used] = 0.0;
        for (size_t i = 0; i < count; i++)
            if (isfinite(square[i]))
                cost[used] += log1p(LIGHT_CAUCHY * square[i] / (scale * scale)) / (double)count;
        used++;
    }
    return used;
}

/* The share of the cost that `better` saves over `base`; 0 when that is not significant. */
static double gain_of(const double *base, const double *better, size_t count) {
    struct validation v = {0};
    for (size_t i = 0; i < count; i++)
        validation_add(&v, base[i], better[i]);
    return validation_is_significant(&v, MIN_SIGNIFICANCE) && v.total > 0.0 ? v.saved / v.total : 0.0;
}

static double drift_of(const struct light_fit *f, const double *x) {
    double squares = 0.0;
    for (size_t t = 0; t < f->frames; t++) {
        double level = (x[3 * t] + x[3 * t + 1] + x[3 * t + 2]) / 3.0;
        squares += f->exposure_known[t] ? level * level : 0.0;
    }
    return sqrt(squares / fmax(1.0, (double)(f->frames - f->unknown_exposure_count)));
}

/* Forward selection: accepts those faults one by one, a tone curve before all others, since free exposures imitate it
 * with many numbers, then the one with the largest gain. Returns the model; x is its solution. */
static int choose_model(struct light_fit *f, int faults, double *x) {
    size_t n = light_fit_parameter_count(f), points = f->o->point_count / LIGHT_HELD_OUT_EVERY + 1, used;
    double *base = mem_array(points, sizeof *base), *cost = mem_array(points, sizeof *cost);
    double *trial = mem_array(n, sizeof *trial), *best = mem_array(n, sizeof *best);
    int model = 0;
    for (;;) {
        int chosen = 0;
        double most = MIN_GAIN, scale;
        light_fit_solve(f, model, x);
        scale = f->scale;
        held_out_costs(f, model, x, scale, base);
        for (int fault = LIGHT_TONES; fault <= LIGHT_ALL && chosen != LIGHT_TONES; fault *= 2) {
            if ((model & fault) || !(faults & fault) ||
                (fault == LIGHT_DRIFT && f->unknown_exposure_count == f->frames) ||
                (fault == LIGHT_TONES && !f->may_bend))
                continue;
            memcpy(trial, x, n * sizeof *trial);
            light_fit_solve(f, model | fault, trial);
            used = held_out_costs(f, model | fault, trial, scale, cost);
            double gain = gain_of(base, cost, used);
            if (gain > most && (fault != LIGHT_DRIFT || drift_of(f, trial) > MIN_DRIFT)) {
                most = gain;
                chosen = fault;
                memcpy(best, trial, n * sizeof *best);
            }
        }
        if (chosen == 0)
            break;
        model |= chosen;
        memcpy(x, best, n * sizeof *x);
    }
    mem_free(best);
    mem_free(trial);
    mem_free(cost);
    mem_free(base);
    return model;
}

/* --- the whole -------------------------------------------------------------------------------- */

/* Root mean squared deviation of observations from the mean of their point. */
static double spread(const struct light_fit *f, const double *x) {
    double squares = 0.0, freedom = 0.0;
    for (size_t p = 0; p < f->o->point_count; p++) {
        size_t first = f->o->start[p], count = f->o->start[p + 1] - first;
        for (int c = 0; c < 3; c++) {
            double sum = 0.0, square = 0.0;
            for (size_t i = first; i < first + count; i++) {
                double y = light_fit_value(f, i, c) - light_fit_predict(f, x, i, c);
                sum += y;
                square += y * y;
            }
            squares += square - sum * sum / (double)count;
            freedom += (double)count - 1.0;
        }
    }
    return freedom > 0.0 ? sqrt(squares / freedom) : 0.0;
}

/* Fixes the gauge: a mean level or mean colour that nothing determines is 0. */
static void fix_gauge(const struct light_fit *f, int model, double *x) {
    double mean[3] = {0};
    for (size_t t = 0; t < f->frames; t++) {
        for (size_t c = 0; c < 3; c++)
            mean[c] += x[3 * t + c] / (double)f->frames;
    }
    double level = (mean[0] + mean[1] + mean[2]) / 3.0;
    bool level_free = f->unknown_exposure_count == f->frames || (model & LIGHT_DRIFT);
    for (size_t t = 0; t < f->frames; t++) {
        for (size_t c = 0; c < 3; c++)
            x[3 * t + c] -= (level_free ? level : 0.0) + (model & LIGHT_COLOR ? mean[c] - level : 0.0);
    }
}

static void apply(const struct light_fit *f, int model, const double *x, struct scene *scene) {
    for (size_t t = 0; t < f->frames; t++) {
        struct photograph *photo = &scene->photograph[f->views->train[t]];
        const double *g = x + 3 * t;
        double level = f->exposure_known[t] ? 0.0 : (g[0] + g[1] + g[2]) / 3.0;
        photo->exposure *= (float)exp(level);
        if (model & (LIGHT_DRIFT | LIGHT_COLOR))
            photo->gain = rgb_mul(
                photo->gain, rgb_make((float)exp(g[0] - level), (float)exp(g[1] - level), (float)exp(g[2] - level)));
    }
    for (size_t i = 0; i < scene->photograph_count && (model & LIGHT_VIGNETTE); i++) {
        for (size_t k = 0; k < 3; k++)
            scene->photograph[i].vignette[k] += (float)x[3 * f->frames + k];
    }
    if (model & LIGHT_TONES)
        tone_straighten(&f->tones, scene);
}

void calibrate_light(struct scene *scene, const struct views *views, const struct atlas *atlas,
                     const struct inverse_uv *inverse, int faults, struct parallel *pool, struct light_found *found) {
    struct overlaps overlaps;
    struct light_fit fit;
    size_t points = POINTS_PER_FRAME * views->train_count;
    points = points < POINTS_MIN ? POINTS_MIN : points > POINTS_MAX ? POINTS_MAX : points;
    overlaps_make(&overlaps, views, atlas, inverse, points, pool);
    light_fit_init(&fit, views, &overlaps);
    double *x = mem_calloc(light_fit_parameter_count(&fit), sizeof *x);
    *found = (struct light_found){.exposures_solved = fit.unknown_exposure_count, .spread_before = spread(&fit, x)};
    int model = faults != 0 ? choose_model(&fit, faults, x) : 0;
    if (model != 0 || fit.unknown_exposure_count > 0) {
        fit.all_points = true;
        light_fit_solve(&fit, model, x);
    } else {
        light_fit_bend(&fit, x); /* not the one that was tried last */
    }
    fix_gauge(&fit, model, x);
    found->spread_after = spread(&fit, x);
    found->drift = (model & LIGHT_DRIFT) != 0;
    found->white_balance = (model & LIGHT_COLOR) != 0;
    found->vignette = (model & LIGHT_VIGNETTE) != 0;
    found->tones = (model & LIGHT_TONES) != 0;
    found->is_power_open = fit.may_bend && light_fit_is_power_open(&fit, 0);
    memcpy(found->curve.term, x + light_fit_parameter_count(&fit) - TONE_TERMS, sizeof found->curve.term);
    apply(&fit, model, x, scene);
    mem_free(x);
    light_fit_release(&fit);
    overlaps_release(&overlaps);
}
