/* detail.h -- texture as fine as the photographs together tell it.
 *
 * A pixel shows the mean over what it covers, so base colours read from photographs are blurred, the more the
 * further away those were taken. Here the photographs are made anew from the texture, each pixel from its
 * footprint, and where they come out otherwise than they are the texels beneath are moved by it (back-projection;
 * Irani and Peleg 1991). Only what differs within a few pixels counts: light and highlights, which are smooth, are
 * not texture. A step is taken as far as the photographs of a texel agree on it, and not at all where one alone tells.
 *
 * Sharpening makes noise larger, too. So the draw of it that `measured` holds goes the same way, with the photographs
 * of one half taken with the other sign, as in halves.h: what the two halves agree on cancels. */
#ifndef UNBAKE_RECONSTRUCT_DETAIL_H
#define UNBAKE_RECONSTRUCT_DETAIL_H

#include <stdbool.h>
#include <stdint.h>

#include "server/capture/views.h"
#include "server/reconstruct/denoise.h"
#include "server/reconstruct/reconstruction.h"

struct detail {
    const struct reconstruction *r;  /* borrowed, as all but the pictures */
    const struct views *views;
    const uint16_t (*white)[3];      /* [height][width] what a white texel would send out; 0: not known */
    struct measured *measured;       /* [height][width] value and noise are written */
    uint16_t (**off[2])[3];          /* [train_count][pixels] of value and noise: what a pixel shows beyond what
                                      * the texture tells; both owned */
};

/* Texels that a pixel covers, in the mean: where it is no more than one, no detail is lost that a texture could hold. */
double detail_texels_a_pixel(const struct reconstruction *r, const struct views *views);

void detail_init(struct detail *d, const struct reconstruction *r, const struct views *views,
                 const uint16_t (*white)[3], struct measured *measured);
void detail_release(struct detail *d);

/* One step of all texels. Each of the first few finds about half of what is left. */
void detail_step(struct detail *d);

#endif
