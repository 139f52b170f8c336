/* overlap.h -- points of the surface that several photographs see, and the observation of each.
 *
 * Whatever the surface is, its photographs should agree: these observations measure the photographs. Points are spread
 * evenly over the atlas; a value is the mean of a small cross of pixels, whose contrast bounds the effect of noise,
 * texture and wrong poses. Pixels that mix surfaces, are saturated or black take no part. The range in which a value is
 * to be trusted is given beside it: selection by the noisy value itself would keep what noise made brighter. */
#ifndef UNBAKE_CAPTURE_OVERLAP_H
#define UNBAKE_CAPTURE_OVERLAP_H

#include <stddef.h>
#include <stdint.h>

#include "common/parallel.h"
#include "server/capture/views.h"
#include "server/scene/atlas.h"
#include "server/scene/inverse_uv.h"

/* Photographs a point, a random subset where more see it: bounds time and memory. */
#define OVERLAP_OBSERVATIONS_MAX 12 /* +25 %: no change */

/* One photograph's observation of one point. */
struct overlap_observation {
    uint32_t train;                   /* index into views.train */
    float x, y;                       /* image position, pixels */
    float cosine;                     /* between the normal and the direction to the camera */
    float value[3];                   /* log radiance, by the present exposure, gain and falloff */
    float min_value[3], max_value[3]; /* range in which `value` is usable: between dark and clipped, with margin */
    float level[3];                   /* log of the stored value */
    float contrast;                   /* standard deviation of the cross over its mean */
};

struct overlaps {
    size_t point_count;
    size_t *start;                           /* [point_count + 1] into `observation`; at least two a point; owned */
    struct overlap_observation *observation; /* owned */
};

/* Observes up to `points` points. The same for any number of threads. */
void overlaps_make(struct overlaps *o, const struct views *views, const struct atlas *atlas,
                   const struct inverse_uv *inverse, size_t points, struct parallel *pool);
void overlaps_release(struct overlaps *o);

#endif
