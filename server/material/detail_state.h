/* detail_state.h -- what the parts of detail.h share: its input, the pixels' and the texels' arrays, and sums over
 * pixels.
 *
 * Pixels are processed on all threads. Their contributions to texels are summed in integers, whose result does not
 * depend on the order. */
#ifndef UNBAKE_MATERIAL_DETAIL_STATE_H
#define UNBAKE_MATERIAL_DETAIL_STATE_H

#include <math.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "common/parallel.h"
#include "server/capture/noise.h"
#include "server/capture/views.h"
#include "server/material/measurement.h"
#include "server/scene/surface.h"

#define DETAIL_CHUNK 4096      /* texels a work item */
#define DETAIL_NONE UINT32_MAX /* no triangle, no chart */

/* What detail reads, and `measured`, which it writes. Borrowed. */
struct detail_input {
    struct surface surface;
    const struct views *views;
    const struct noise *noise;    /* of the photographs */
    const bool *is_emitter;       /* [segment_count] */
    const uint16_t (*lambert)[3]; /* [height][width] radiance at albedo 1 (divide.h); 0: not known */
    struct measurement *measured; /* [height][width] value and noise are written */
    struct parallel *pool;
};

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
    float variance;    /* of the residual of a pixel of weight 1, by the photographs' noise */
    float t, momentum; /* FISTA's t and momentum */
};

static inline size_t detail_chunks(const struct detail *d) {
    return (d->in.surface.inverse->valid_count + DETAIL_CHUNK - 1) / DETAIL_CHUNK;
}

/* Adds to one of a texel's sums; a value is to be multiplied by sum_scale before. */
static inline void detail_add(_Atomic int32_t *sum, float scaled) {
    atomic_fetch_add_explicit(sum, (int32_t)lrintf(scaled), memory_order_relaxed);
}

static inline void detail_clear_sums(struct detail *d) {
    for (size_t i = 0; i < d->in.surface.inverse->valid_count; i++)
        for (int k = 0; k < 3; k++)
            d->sum[d->in.surface.inverse->valid[i]][k] = 0;
}

#endif
