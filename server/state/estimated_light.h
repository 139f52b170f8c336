/* estimated_light.h -- light sources whose radiance is inferred from what they light, with their standard deviations.
 *
 * Plain memory, as checkpoints keep it. */
#ifndef UNBAKE_STATE_ESTIMATED_LIGHT_H
#define UNBAKE_STATE_ESTIMATED_LIGHT_H

#include <stddef.h>
#include <stdint.h>

#include "common/vec.h"

/* Sources, at most. */
#define ESTIMATED_MAX 288
#define ESTIMATED_FACTORS 4 /* times that saturated sky may be brightened */

enum estimated_kind {
    ESTIMATED_HIDDEN,           /* a segment that no photograph shows */
    ESTIMATED_SATURATED,        /* a segment at which every photograph saturates */
    ESTIMATED_SATURATED_SKY,    /* the directions above the horizon at which they do */
    ESTIMATED_SEEN,             /* a segment whose radiance is measured, but for its error */
    ESTIMATED_SATURATED_GROUND, /* the directions below the horizon at which they do */
    ESTIMATED_OPENING,          /* a segment around a scan, from where light comes in (openings.h) */
    ESTIMATED_SUN               /* a sun in whose light photographs saturate (sun_clipped.h) */
};

struct estimated_source {
    uint32_t kind, segment; /* segment: of hidden, saturated and opening */
    rgb radiance;           /* of sky and ground: the mean; of the sun: irradiance over pi */
    float deviation;        /* standard deviation of its logarithm */
};

struct estimated_light {
    uint32_t source_count, factor_count;
    struct estimated_source source[ESTIMATED_MAX];
    rgb sky_factor[ESTIMATED_FACTORS];    /* by which solve brightened the saturated sky, one after another */
    rgb ground_factor[ESTIMATED_FACTORS]; /* the same of the ground; 0: as the sky, in checkpoints before format 5 */
    float deviation; /* standard deviation of the logarithm of all light, an error that all base colours share; 0: all
                      * light was measured, or the checkpoint is of a format before 6 */
};

#endif
