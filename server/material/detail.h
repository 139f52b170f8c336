/* detail.h -- texture as fine as the photographs together tell it.
 *
 * A pixel shows the mean over what it covers, so base colours read from photographs are blurred, the more the
 * further away those were taken. Here those are found that show what all the photographs do, each pixel by its
 * footprint: the least squares of what pixels are off by, weighed by their noise, no base colour darker than black, by
 * accelerated projected gradients (FISTA; Beck and Teboulle 2009). Only what differs within a few pixels counts: light
 * and highlights, which are smooth, are not texture.
 *
 * Sharpening makes noise larger, too. A texel is drawn back to where it was by the share of noise in what it is off by,
 * told by one half of the photographs against the other (halves.h), in several ways to part them: in a single one the
 * only sharp photograph of a place may stand alone. Where one half always tells next to nothing a texel stays. The
 * draw of noise in `measured` has all in which the photographs did not agree, their blur as well: of it as much is
 * taken away. (Noise drawn by pixels and sharpened alike in its place takes texture for noise.) */
#ifndef UNBAKE_MATERIAL_DETAIL_H
#define UNBAKE_MATERIAL_DETAIL_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "server/capture/views.h"
#include "server/material/measured.h"
#include "server/state/reconstruction.h"

struct detail {
    const struct reconstruction *r;  /* borrowed, as the next three */
    const struct views *views;
    const uint16_t (*white)[3];      /* [height][width] what a white texel would send out; 0: not known */
    struct measured *measured;       /* [height][width] value and noise are written */
    /* Of each photograph, [train_count][pixels], 14 bytes a pixel of all of them together; owned. */
    uint32_t **triangle;             /* that is shown; UINT32_MAX: the pixel is not asked */
    float **worth;                   /* inverse variance by noise, up to a factor; at most 1 */
    uint16_t (**off)[3];             /* base colour that it shows beyond what the texture told at first */
    /* Of each texel, [height][width]; owned. */
    uint32_t *chart_of_texel;        /* UINT32_MAX where it is not known what it sends out */
    _Atomic int32_t (*sum)[3];       /* over pixels, by sum_scale */
    float *count;                    /* pixels, by their worth */
    float *told;                     /* share of what it is off by that is not noise; 0: the texel stays */
    uint16_t (*moved)[2][3];         /* base colour: by the last step and by the one before */
    float sum_scale;
    float pace, onward;              /* of the acceleration: its sequence, and how much further steps go */
};

/* Texels that a pixel covers, in the mean: where it is no more than one, no detail is lost that a texture could hold. */
double detail_texels_a_pixel(const struct reconstruction *r, const struct views *views);

void detail_init(struct detail *d, const struct reconstruction *r, const struct views *views,
                 const uint16_t (*white)[3], struct measured *measured);
void detail_release(struct detail *d);

/* One step of all texels. */
void detail_step(struct detail *d);

/* After the last step: writes what was found. */
void detail_finish(struct detail *d);

#endif
