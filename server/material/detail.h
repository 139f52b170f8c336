/* detail.h -- deconvolution of base colour: texture finer than a photograph's pixel.
 *
 * A pixel averages its footprint, so base colours read from photographs are blurred, the more the further away these
 * were taken. Detail solves for the base colours whose footprint averages match all photographs: weighted least squares
 * of the pixels' residuals, base colour at least 0, by accelerated projected gradients (FISTA; Beck and Teboulle 2009).
 * Residuals are high-pass filtered over a few pixels, since errors of light and highlights are smooth.
 *
 * Deconvolution amplifies noise. Each texel's correction is shrunk by the share of noise in its residual, measured by
 * one half of the photographs against the other (halves.h). Several splits are used, since in one the only sharp
 * photograph of a place may be alone in its half; where one half always has almost no weight a texel is not changed.
 * The noise sample in `measured` includes the differences of blur between photographs, so it is reduced by the same
 * share. (A noise sample drawn per pixel and deconvolved alike takes texture for noise.) */
#ifndef UNBAKE_MATERIAL_DETAIL_H
#define UNBAKE_MATERIAL_DETAIL_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "server/capture/noise.h"
#include "server/capture/views.h"
#include "server/material/measured.h"
#include "server/scene/surface.h"

/* What detail reads, and `measured`, which it writes. Borrowed. */
struct detail_input {
    struct surface surface;
    const struct views *views;
    const struct noise *noise;    /* of the photographs */
    const bool *is_emitter;       /* [segment_count] */
    const uint16_t (*lambert)[3]; /* [height][width] radiance at albedo 1 (divide.h); 0: not known */
    struct measured *measured;    /* [height][width] value and noise are written */
    struct parallel *pool;
};

#define DETAIL_PIXEL_BYTES 14 /* of triangle, weight and residual */

struct detail {
    struct detail_input in;
    /* Of each photograph, [train_count][pixels], DETAIL_PIXEL_BYTES a pixel of all of them together, of the scene's
     * spill; owned. */
    uint32_t **triangle;      /* that the pixel shows; UINT32_MAX: the pixel is not used */
    float **weight;           /* inverse noise variance, up to a factor; at most 1 */
    uint16_t (**residual)[3]; /* residual of the starting texture, base colour, high-pass filtered */
    /* Of each texel, [height][width]; owned. */
    uint32_t *chart_of_texel;  /* UINT32_MAX where base colour or light is not known */
    _Atomic int32_t (*sum)[3]; /* over pixels, times sum_scale */
    float *weight_sum;         /* sum of the pixels' weights */
    float *signal_share;       /* share of the residual that is not noise; 0: the texel is not changed */
    uint16_t (*change)[2][3];  /* change of base colour after the last step and after the one before */
    float sum_scale;
    float t, momentum; /* FISTA's t and momentum */
};

/* Mean number of texels that a pixel covers; up to one, nothing is blurred at the texture's resolution. */
double detail_texels_per_pixel(const struct surface *surface, const struct views *views);

/* Makes room for the arrays with an element a pixel, before detail_init. */
enum status detail_reserve(const struct views *views, struct error *err);
void detail_init(struct detail *d, const struct detail_input *input);
void detail_release(struct detail *d);

/* One step of FISTA. */
void detail_step(struct detail *d);

/* After the last step: adds the changes to `measured`. */
void detail_finish(struct detail *d);

#endif
