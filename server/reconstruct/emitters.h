/* emitters.h -- the decision which segments emit.
 *
 * With method=listing1, until the decision every segment that photographs show emits a part of what
 * they show of it (the larger the brighter it is) and base colour makes up the rest, so that each
 * surface sends out about the light that the photographs measured, whatever part of it is its own. The light that arrives at a segment is
 * then right too, and tells what the segment could reflect: base colour 1 at most. A segment
 * whose photographs show clearly more than that is an emitter (the residual of FIPT, Wu et al.
 * 2023, taken by segment). */
#ifndef UNBAKE_RECONSTRUCT_EMITTERS_H
#define UNBAKE_RECONSTRUCT_EMITTERS_H

#include "server/capture/views.h"
#include "server/reconstruct/look.h"
#include "server/reconstruct/reconstruction.h"

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
#define EMITTERS_AS_BRIGHT 0.7f
static inline bool emitters_is_bright(const struct reconstruction *r, uint32_t texel) {
    float shown = rgb_mean(r->evidence[reconstruction_segment(r, texel)].shown);
    return rgb_mean(fused_radiance(&r->fused, texel)) > EMITTERS_AS_BRIGHT * shown;
}

/* Fills `shown`, `least`, `bound`, `seen` and `mixed` of evidence[segment_count] from up to a few hundred texels of
 * each; not those of hidden lamps, nor `shown` of what is unbound. */
void emitters_observe(const struct reconstruction *r, const struct views *views,
                      struct emitter_evidence *evidence);

/* Makes lights of what outshines the room, before it is known what emits: its emission is what is shown of it,
 * own and reflected light together; that of all else is 0. */
void emitters_light_bright(struct reconstruction *r, const struct views *views,
                           const struct emitter_evidence *evidence);

/* Fills `arrived` by looks at the present state of the materials, decides, and gives every emitter
 * in r->materials its radiance: what is shown less what a neutral base colour would reflect.
 * batch[threads] is scratch for EMITTERS_TEXELS texels. */
#define EMITTERS_TEXELS 32
void emitters_decide(struct reconstruction *r, const struct views *views, struct look_batch *batch,
                     struct emitter_evidence *evidence);

#endif
