/* solve_emitters.h -- which segments emit, and how much.
 *
 * A segment emits if it is brighter than a surface of base colour 1 could be in the light that arrives there, if its
 * own light changed between photographs (changing_light.h), or if it is a lamp that no photograph shows. */
#ifndef UNBAKE_RECONSTRUCT_SOLVE_EMITTERS_H
#define UNBAKE_RECONSTRUCT_SOLVE_EMITTERS_H

#include "server/capture/views.h"
#include "server/material/divide.h"
#include "server/state/reconstruction.h"

struct solve_emitters {
    struct reconstruction *r; /* borrowed, all three */
    const struct views *views;
    const struct divide *divide;
    bool *pattern_emitters; /* [segment_count] is_emitter at the last search for patterns; owned */
};

void solve_emitters_init(struct solve_emitters *s, struct reconstruction *r, const struct views *views,
                         const struct divide *divide);
void solve_emitters_release(struct solve_emitters *s);

/* Decides r->is_emitter by the light that `divide` has at the surfaces; fills in r->evidence what it finds. */
void solve_emitters_decide(struct solve_emitters *s);

/* Makes lights of the emitters by their outgoing radiance, emitted and reflected: writes r->materials' emission and
 * pattern. */
void solve_emitters_light(struct solve_emitters *s);

/* Sets emission without what is reflected, and base colour, of the emitters. */
void solve_emitters_finish(struct solve_emitters *s);

#endif
