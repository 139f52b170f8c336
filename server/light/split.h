/* split.h -- parts of segments that shine become segments of their own.
 *
 * A segment emits as a whole or not at all, and a screen in its bezel, or a bulb in its fixture, often is one
 * segment with it, given or made from the shape. Here a connected part of a segment is split off that all
 * over shows more than a white surface could reflect of what arrives there, while what is left of the
 * segment is at most half as bright and of some size as well. It says nothing yet of what emits: that is
 * decided later, for all segments alike (emitters.h).
 *
 * What is only painted white, a highlight (shining from some places only) and a patch of sun are left
 * where they are (shining.h).
 *
 * Limits. Triangles are not cut: a lit part of one is not found. Nor is a screen that shows less than white
 * paper in its place would. Light of a sun that no photograph shows, through an opening that the mesh does
 * not have, makes what it falls on look like something that shines. */
#ifndef UNBAKE_LIGHT_SPLIT_H
#define UNBAKE_LIGHT_SPLIT_H

#include <stddef.h>
#include <stdint.h>

#include "server/capture/views.h"
#include "server/state/reconstruction.h"

/* The segments that hold parts which shine: parts are the new segments [old_count, r->segments.count). */
struct split {
    size_t old_count, part_count;
    uint32_t *whole; /* [part_count] the segment that a part was taken from; owned */
};

/* Needs exposures, the environment and the world of r; changes r->segments only, so that all that was made from it
 * is to be made anew where part_count is not 0. A part has the id of the whole. The same for any number
 * of threads. */
void split_segments(struct split *split, struct reconstruction *r, const struct views *views);
void split_release(struct split *split);

#endif
