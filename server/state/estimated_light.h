/* estimated_light.h -- light sources whose radiance is inferred from what they light, with their standard deviations.
 *
 * Plain memory, as checkpoints keep it. */
#ifndef UNBAKE_STATE_ESTIMATED_LIGHT_H
#define UNBAKE_STATE_ESTIMATED_LIGHT_H

#include <stddef.h>
#include <stdint.h>

#include "common/vec.h"

/* Sources, at most. */
#define ESTIMATED_MOST 288

enum estimated_kind {
    ESTIMATED_HIDDEN,        /* a segment that no photograph shows */
    ESTIMATED_SATURATED,     /* a segment at which every photograph saturates */
    ESTIMATED_SATURATED_SKY, /* the directions at which they do */
    ESTIMATED_SEEN           /* a segment whose radiance is measured, but for its error */
};

struct estimated_source {
    uint32_t kind, segment; /* segment: of the first two kinds */
    rgb radiance;           /* of the sky: the mean */
    float deviation;        /* standard deviation of its logarithm */
};

struct estimated_light {
    uint32_t source_count, factor_count;
    struct estimated_source source[ESTIMATED_MOST];
    rgb sky_factor[4]; /* by which solve brightened the saturated sky, one after another */
};

#endif
