/* hole_evidence.h -- whether a region of cells is a hole of the scan or an opening of the room.
 *
 * A hole's surface is in its place: photographs from different places agree about each of its cells, but not about
 * directions, in which distant light would be the same from everywhere. And it goes on: across the hole's rim radiance
 * changes no more than beside it. Where photographs tell the two apart, the first decides; where the surface is plain,
 * as most walls are, the second. */
#ifndef UNBAKE_HOLES_HOLE_EVIDENCE_H
#define UNBAKE_HOLES_HOLE_EVIDENCE_H

#include "server/holes/hole_observations.h"

/* Variance of log radiance among photographs, over that of the plane's own surface, beyond which no surface is there:
 * three times the deviation. */
#define HOLE_MOST_VARIANCE 9.0

/* Mean of squared deviations of log radiance, and its degrees of freedom. */
struct hole_scatter {
    double variance, freedom;
};

struct hole_region {
    uint32_t first_cell;            /* of the cells whose `region` is this one's number */
    uint32_t cells, rim;            /* cells; of those, beside covered ones or beside what is no surface */
    uint32_t contact;               /* of the rim: beside covered ones */
    size_t observations;            /* pixels that show it */
    double saturated;               /* share of them */
    struct hole_scatter here, away; /* by cell; by direction */
    double beside;                  /* variance of the plane's covered cells */
    double step, usual_step;        /* medians of the change of log radiance across the rim, and beside it */
    bool is_hole, is_hidden;        /* hidden: no photograph shows it (hidden_holes.h), and nothing above */
};

struct hole_regions {
    size_t count;
    struct hole_region *region; /* [count]; owned */
};

/* Fills in the evidence of all regions, and whether they are holes. */
void hole_evidence_find(struct hole_regions *regions, const struct hole_grid *grid,
                        const struct hole_observations *observations);

#endif
