/* gloss_belief.h -- how glossy a segment is believed to be, by its own photographs and those of segments like it.
 *
 * Photographs seldom tell the gloss of small things, but what is of one colour often is of one material: a door and its
 * frame, the legs of a table. So segments of about the same base colour are thought to have one common material, of which
 * nothing else is known; each of them is of it with a probability that falls with the difference of the colours, and
 * of any other material otherwise. Where what photographs tell of them does not agree, they hardly move each other.
 * Large segments take no part: mostly they are painted walls, whose white many other things have too. */
#ifndef UNBAKE_MATERIAL_GLOSS_BELIEF_H
#define UNBAKE_MATERIAL_GLOSS_BELIEF_H

#include <stdbool.h>
#include <stddef.h>

#include "common/vec.h"
#include "server/material/gloss_look.h"

/* Of a segment: matt, then all pairs of gloss_levels. */
#define GLOSS_CANDIDATES (1 + HIGHLIGHT_ROUGHNESSES * HIGHLIGHT_SPECULARS)
#define GLOSS_MATT 0

/* Levels k of roughness and m of specular. */
static inline size_t gloss_candidate(size_t k, size_t m) { return 1 + k * HIGHLIGHT_SPECULARS + m; }

/* Rougher highlights cannot be told from matt reflection, and are not believed in; of one of .8 large walls tell by 3
 * to 10 standard errors. */
#define GLOSS_ROUGHEST 0.8f

struct gloss_told {
    bool any;      /* enough photographs speak of the segment; else the rest says nothing */
    double part;   /* of the surface that is this segment's */
    rgb base_color;
    double likelihood[GLOSS_CANDIDATES]; /* of what they show under each candidate, 1 at most */
    size_t best;           /* the likeliest candidate */
    double best_roughness; /* which lies between the levels */
};

/* How likely matt is, and the means over all candidates. */
struct gloss_belief {
    double matt, roughness, specular;
};

/* Of told[segment], of which something must be told. */
struct gloss_belief gloss_believe(const struct gloss_told *told, size_t count, size_t segment);

#endif
