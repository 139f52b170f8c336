/* evidence.h -- what is known of each segment's own light, on which the decision whether it emits rests.
 *
 * server/light fills it; solve.c and, of listing1, emitter_decision.c decide by it. */
#ifndef UNBAKE_STATE_EVIDENCE_H
#define UNBAKE_STATE_EVIDENCE_H

#include <stdbool.h>

#include "common/vec.h"
#include "server/capture/fuse.h"
#include "server/state/reconstruction.h"

/* What is known of a segment's light. */
struct emitter_evidence {
    rgb shown;   /* radiance that the photographs show, median by channel; 0: nothing is seen of it */
    rgb least;   /* the same: it stays when `shown` is made brighter */
    bool seen;   /* some photograph shows it, and not what is beside or behind it */
    bool mixed;  /* it was only seen in pixels that mix surfaces */
    bool hidden; /* a lamp that no photograph shows: `shown` is told by what it lights (lamp_find.h) */
    bool bound[3]; /* by channel: half of what shows it saturates or more, and `least` is a lower bound */
    bool unbound;  /* such a lamp: `shown` is told by what it lights (saturated_light.h) */
    rgb arrived; /* radiance that a white diffuse surface there would reflect, mean by channel */
    float share; /* part of `shown` that base colour 1 could not reflect */
    float changes; /* share of its surface whose light changed between photographs (changing_light.h) */
    float doubt; /* radiance that a white surface there would send of unseen sky (sky_doubt.h) */
};

/* Whether a texel shows about what its segment was observed to show. */
#define EVIDENCE_AS_BRIGHT 0.7f
static inline bool evidence_is_bright(const struct reconstruction *r, uint32_t texel) {
    float shown = rgb_mean(r->evidence[reconstruction_segment(r, texel)].shown);
    return rgb_mean(fused_radiance(&r->fused, texel)) > EVIDENCE_AS_BRIGHT * shown;
}

#endif
