/* match.h -- what one look tells of base colour: what was shown beside what was rendered.
 *
 * To first order a surface's radiance is its base colour times its light, so the ratio of the two is the factor by
 * which base colour is off; its noise is that of one estimate, where the gradient's is that of a product of two. */
#ifndef UNBAKE_REFINE_MATCH_H
#define UNBAKE_REFINE_MATCH_H

#include "common/vec.h"
#include "server/scene/photograph.h"

/* What one look tells, relative to what its texel is expected to show, by channel. (Relative to what
 * this photograph shows, its noise would be on both sides, and their mean ratio off by its variance.) */
struct match {
    float shown[3];    /* by the photograph, over (expected + a share of the median) */
    float rendered[3]; /* over the same */
    float worth[3];    /* of that channel: 1, or less the more noise the photograph has there */
    float trust;       /* half where the photograph is off by all that is expected, or by more where its noise is that
                        * far: a highlight, or light of what is in front */
};

/* From reference[sample_count] and radiance[sample_count] of one look. A saturated channel that the
 * render exceeds too counts as equal. `noise` is the deviation of the photograph's there, in radiance;
 * `median_radiance` is the photographs'. */
struct match match_look(const struct photograph_sample *reference, const rgb *radiance,
                        int sample_count, rgb expected, rgb noise, float median_radiance);

#endif
