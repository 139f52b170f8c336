/* gloss_look.h -- what photographs show of a few places of a segment, and what each material would send there.
 *
 * A photograph is read at several places around a texel, which takes out its noise, the more the wider they lie; their
 * base colour may differ, it is the same in all photographs. The diffuse lobe and the highlight of every candidate
 * roughness and specular are gathered at the same places: they may be curved. */
#ifndef UNBAKE_MATERIAL_GLOSS_LOOK_H
#define UNBAKE_MATERIAL_GLOSS_LOOK_H

#include <stddef.h>
#include <stdint.h>

#include "server/capture/views.h"
#include "server/gather/highlight.h"
#include "server/gather/probes.h"
#include "server/scene/by_segment.h"
#include "server/state/reconstruction.h"

#define GLOSS_VIEWS 10        /* photographs of a texel, at most */
#define GLOSS_POINTS_MOST 1024 /* texels of a segment, at most */
#define GLOSS_PATCH_LEAST 8.0f /* texels a side of what is looked at around a texel, at least */

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

/* How closely a segment is looked at. */
struct gloss_way {
    float patch;  /* texels a side of what is looked at around a texel */
    int edge;     /* greatest class of the pixels (views.h) */
    size_t least; /* photographs that must show a texel */
};

/* The widest patch, within reason, of which a segment has room for many. */
float gloss_widest_patch(const struct gloss_looker *l, size_t segment);

/* So many texels of a segment are asked for. */
size_t gloss_points_of(const struct gloss_looker *l, size_t segment);

/* Fills point[GLOSS_POINTS_MOST] with so many texels of a segment, or fewer; returns their number. */
size_t gloss_look_at(const struct gloss_looker *l, size_t segment, struct gloss_way way, int thread,
                     struct gloss_point *point);

#endif
