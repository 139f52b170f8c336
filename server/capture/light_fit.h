/* light_fit.h -- the equations behind calibrate_light.h: exposure, colour and vignette that make
 * photographs agree where they overlap, for a given set of faults.
 *
 * Parameters x are in logarithms: G[f][c] of each training photograph f and channel c, then v of the
 * vignette. Robust: looks far from their point's mean lose weight. Points that are held back take
 * part in no solve and judge it. */
#ifndef UNBAKE_CAPTURE_LIGHT_FIT_H
#define UNBAKE_CAPTURE_LIGHT_FIT_H

#include <stdbool.h>
#include <stddef.h>

#include "server/capture/overlap.h"
#include "server/capture/views.h"

#define LIGHT_HELD_BACK_EVERY 4

/* A model is a sum of the faults that it allows; the others are held at none. */
enum { LIGHT_DRIFT = 1, LIGHT_COLOR = 2, LIGHT_VIGNETTE = 4, LIGHT_FAULTS = 8 };

struct light_fit {
    const struct overlaps *o;     /* borrowed, both */
    const struct views *views;
    size_t frames;                /* parameters are 3 a frame and 3 of the vignette */
    size_t unknown_exposure_count;          /* frames whose exposure nobody told */
    bool *exposure_known;                   /* [frames] the exposure; owned, as all below */
    double (*radius)[3];          /* [looks] s, s^2, s^3 */
    double *trust;                /* [looks] inverse variance by contrast and angle */
    double *weight;               /* [looks] trust made robust; 0: held back */
    double scale;                 /* residuals are this much larger than trust says */
    bool all_points;              /* nothing is held back */
};

void light_fit_init(struct light_fit *f, const struct views *views, const struct overlaps *o);
void light_fit_release(struct light_fit *f);

static inline size_t light_fit_parameter_count(const struct light_fit *f) {
    return 3 * f->frames + 3;
}

static inline bool light_fit_is_held_back(const struct light_fit *f, size_t point) {
    return !f->all_points && point % LIGHT_HELD_BACK_EVERY == 0;
}

/* Solves the model from x on; sets weights and scale. */
void light_fit_solve(struct light_fit *f, int model, double *x);

/* What x adds to the logarithm of a look's true value. */
double light_fit_predict(const struct light_fit *f, const double *x, size_t observation, int channel);

/* Squared residuals of a point's looks over their expected variance, after the L that weight[] gives;
 * INFINITY where the photograph should show something too dark or too bright. Both [looks of it]. */
void light_fit_residuals(const struct light_fit *f, const double *x, size_t point, const double *weight,
                         double *square);

#endif
