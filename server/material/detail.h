/* detail.h -- deconvolution of base colour: texture finer than a photograph's pixel.
 *
 * A pixel averages its footprint, so base colours read from photographs are blurred, the more the further away these
 * were taken. Detail solves for the base colours whose footprint averages match all photographs: weighted least squares
 * of the pixels' residuals, base colour at least 0, by accelerated projected gradients (FISTA; Beck and Teboulle 2009).
 * Residuals are high-pass filtered over a few pixels, since errors of light and highlights are smooth.
 *
 * Deconvolution amplifies noise. Each texel's correction is shrunk by the share of noise in its residual, measured by
 * one half of the photographs against the other (split_half.h). Several splits are used, since in one the only sharp
 * photograph of a place may be alone in its half; where one half always has almost no weight a texel is not changed.
 * Halves of noise alone agree by chance; as much as the photographs' own noise (noise.h) explains is taken off.
 * The noise sample in `measured` includes the differences of blur between photographs, so it is reduced by the same
 * share. (A noise sample drawn per pixel and deconvolved alike takes texture for noise.) */
#ifndef UNBAKE_MATERIAL_DETAIL_H
#define UNBAKE_MATERIAL_DETAIL_H

#include "server/material/detail_state.h"

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
