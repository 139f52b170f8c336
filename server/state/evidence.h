/* evidence.h -- evidence for the decision whether a segment emits.
 *
 * server/light and server/material fill it; solve.c and, of listing1, emitter_decision.c decide by it. */
#ifndef UNBAKE_STATE_EVIDENCE_H
#define UNBAKE_STATE_EVIDENCE_H

#include <stdbool.h>

#include "common/vec.h"

/* Radiances are by channel. */
struct emitter_evidence {
    rgb radiance;         /* estimated mean outgoing radiance; 0: not observed; set by evidence_set_radiance only */
    rgb observed;         /* median of the photographs; a lower bound in saturated channels */
    bool is_seen;         /* some photograph shows it, and not what is beside or behind it */
    bool only_mixed;      /* observed only in pixels that mix surfaces */
    bool is_hidden;       /* a lamp that no photograph shows: `radiance` is inferred from its light (hidden_lamps.h) */
    bool saturated[3];    /* by channel: at least half of its pixels saturate */
    bool is_unbounded;    /* a saturated lamp whose `radiance` is inferred from its light (light_model.h) */
    float deviation;      /* of such a lamp: standard deviation of the logarithm of `radiance` */
    bool is_sunlit;       /* it saturates in the light of a sun, mostly (sun_clipped.h), and is no lamp */
    bool is_lit;          /* it saturates, but white paint would as well (light_solve.h), and is no lamp */
    bool is_outshone;     /* photographs show it, but no brighter than what is beside or behind it */
    rgb lambert;          /* mean radiance that a Lambertian surface of albedo 1 would reflect there */
    float emitted_share;  /* part of `radiance` beyond `lambert`, in [0, 1] */
    float changing_share; /* part of its surface whose light changed between photographs (changing_light.h) */
    float reflection;     /* probability that reflection would show as much (reflection.h) */
    float sky_lambert;    /* mean radiance of a Lambertian surface of albedo 1 by unobserved sky (sky_doubt.h) */
};

/* Whether `observed` is no more than a lower bound. */
static inline bool evidence_saturates(const struct emitter_evidence *e) {
    return e->saturated[0] || e->saturated[1] || e->saturated[2];
}

static inline void evidence_set_radiance(struct emitter_evidence *e, rgb radiance) { e->radiance = radiance; }

/* Sets `lambert`, and `emitted_share` from it and from `radiance`. */
static inline void evidence_set_lambert(struct emitter_evidence *e, rgb lambert) {
    float radiance = rgb_mean(e->radiance);
    e->lambert = lambert;
    e->emitted_share = radiance > 0.0f ? clampf(1.0f - rgb_mean(lambert) / radiance, 0.0f, 1.0f) : 0.0f;
}

#define EVIDENCE_AS_BRIGHT 0.7f /* least part of the segment's radiance: half a stop below */

/* Whether a radiance is about that of the segment. */
static inline bool evidence_is_as_bright(const struct emitter_evidence *e, rgb radiance) {
    return rgb_mean(radiance) > EVIDENCE_AS_BRIGHT * rgb_mean(e->radiance);
}

#endif
