/* gloss_look.h -- what photographs show of a few places of a segment, and what each material would send there.
 *
 * A photograph is read at several places around a texel, which takes out its noise; their base colour may
 * differ, it is the same in all photographs. The diffuse lobe and the highlight of every candidate
 * roughness and specular are gathered at the same places: they may be curved. */
#ifndef UNBAKE_RECONSTRUCT_GLOSS_LOOK_H
#define UNBAKE_RECONSTRUCT_GLOSS_LOOK_H

#include <stddef.h>
#include <stdint.h>

#include "server/capture/views.h"
#include "server/gather/highlight.h"
#include "server/gather/probes.h"
#include "server/reconstruct/by_segment.h"
#include "server/reconstruct/reconstruction.h"

#define GLOSS_VIEWS 10        /* photographs of a texel, at most */
#define GLOSS_POINTS_MOST 256 /* texels of a segment, at most */

/* Roughness and specular of the candidates. */
extern const struct highlight_levels gloss_levels;

/* One texel as one photograph shows it, and what each candidate sends there. */
struct gloss_look {
    rgb shown;
    rgb white[HIGHLIGHT_ROUGHNESSES]; /* of base colour 1 */
    struct highlight highlight;
};

struct gloss_point {
    size_t count;
    struct gloss_look look[GLOSS_VIEWS];
};

struct gloss_looker {
    const struct reconstruction *r; /* borrowed, as the next three */
    const struct views *views;
    const struct probes *probes;
    const struct light_field *field;
    struct texels_by_segment texels;
    double roots;                   /* sum over the segments of the root of their texels */
    struct incident *scratch;       /* [threads]; owned */
};

void gloss_looker_init(struct gloss_looker *l, const struct reconstruction *r, const struct views *views,
                       const struct probes *probes, const struct light_field *field);
void gloss_looker_release(struct gloss_looker *l);

/* Fills point[GLOSS_POINTS_MOST] with texels of a segment that at least `least` photographs show in pixels of
 * no greater class than `edge` (views.h); returns their number. */
size_t gloss_look_at(const struct gloss_looker *l, size_t segment, int edge, size_t least, int thread,
                     struct gloss_point *point);

#endif
