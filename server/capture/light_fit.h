/* light_fit.h -- the equations behind calibrate_light.h: exposure, colour, vignette and tone curve that make
 * photographs agree where they overlap, for a given set of faults.
 *
 * Parameters x are in logarithms: G[f][c] of each training photograph f and channel c, then v of the vignette, then the
 * terms of the tone curve. Robust: observations far from their point's mean lose weight. Held-out points take part in
 * no solve and judge it. */
#ifndef UNBAKE_CAPTURE_LIGHT_FIT_H
#define UNBAKE_CAPTURE_LIGHT_FIT_H

#include <stdbool.h>
#include <stddef.h>

#include "server/capture/overlap.h"
#include "server/capture/tone_curve.h"
#include "server/capture/views.h"

/* One point in so many is held out to choose the model: the fit keeps three quarters, and the choice has a thousand
 * points of the least number. */
#define LIGHT_HELD_OUT_EVERY 4 /* +25 %: no change */

/* Inverse square of the Cauchy weight's scale, 2 standard deviations: 95 % efficiency at normal errors takes 2.4
 * (Holland & Welsch 1977); less, since highlights are many. */
#define LIGHT_CAUCHY 0.25 /* +25 %: no change */

/* A model is a set of faults; parameters of the others are held at 0. Tones are tried first, right after the fit
 * without them, by which `usable` is. */
enum { LIGHT_TONES = 1, LIGHT_DRIFT = 2, LIGHT_COLOR = 4, LIGHT_VIGNETTE = 8, LIGHT_ALL = 15 };

/* An observation under the tone curve F of the newest solution, by channel; s: log of its stored value, and p of the
 * one that the others of its point foretell. */
struct light_bend {
    float basis[3][TONE_TERMS]; /* at p, which is nearer to the truth than s */
    float added[3];             /* F(s) - s; without it the value is that of a camera without a curve */
};

struct light_fit {
    const struct overlaps *o; /* borrowed, both */
    const struct views *views;
    size_t frames;                 /* parameters are 3 a frame, 3 of the vignette and TONE_TERMS */
    size_t unknown_exposure_count; /* whose exposure is unknown */
    bool *exposure_known;          /* [frames]; owned, as all below */
    double (*radius)[3];           /* [observations] s, s^2, s^3 */
    double *prior_weight;          /* [observations] inverse variance by contrast and angle */
    struct light_bend *bend;       /* [observations] what the tone curve does to each */
    struct tone_table tones;       /* the curve of the newest solution */
    bool may_bend;                 /* no photograph is HDR or straight already */
    uint8_t *usable; /* [observations] bit c: not too dark or bright by what is foretold without a curve */
    double *weight;  /* [observations] prior_weight times the robust weight; 0: held out */
    double scale;    /* of residuals, over what `prior_weight` expects */
    bool all_points; /* no point is held out */
};

void light_fit_init(struct light_fit *f, const struct views *views, const struct overlaps *o);
void light_fit_release(struct light_fit *f);

static inline size_t light_fit_parameter_count(const struct light_fit *f) { return 3 * f->frames + 3 + TONE_TERMS; }

/* Whether a model has free exposures, which explain any power of all radiances: that of the curve stays as it is. */
static inline bool light_fit_is_power_open(const struct light_fit *f, int model) {
    return (model & LIGHT_DRIFT) || 2 * f->unknown_exposure_count > f->frames;
}

static inline bool light_fit_is_held_out(const struct light_fit *f, size_t point) {
    return !f->all_points && point % LIGHT_HELD_OUT_EVERY == 0;
}

/* Solves the model, starting from x; sets weights and scale. */
void light_fit_solve(struct light_fit *f, int model, double *x);

/* Predicted deviation of an observation's logarithm, straightened, from its point's L. */
double light_fit_predict(const struct light_fit *f, const double *x, size_t observation, int channel);
/* The logarithm, straightened by the tone curve. */
double light_fit_value(const struct light_fit *f, size_t observation, int channel);
/* Takes the tone curve over; false where it does not rise. light_fit_solve does it for its solution. */
bool light_fit_bend(struct light_fit *f, const double *x);

/* Squared residuals of a point's observations over their expected variance, about the L that weight[] gives; INFINITY
 * where the prediction is too dark or too bright for the photograph. Under a curve those stay so that were without,
 * since a curve could leave out what it does not explain. Both arrays [observations of the point]. */
void light_fit_residuals(const struct light_fit *f, int model, const double *x, size_t point, const double *weight,
                         double *square);

#endif
