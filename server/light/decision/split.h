/* split.h -- splits bright parts off their segments.
 *
 * A segment emits as a whole or not at all, but a screen and its bezel, or a bulb and its fixture, often are one
 * segment. A connected part is split off if all of it is brighter than a white surface could be there, and the rest of
 * the segment is at most half as bright and large enough. One at which all photographs saturate, mostly in all
 * channels, may be as much brighter than it seems as what lights it, and consists of the triangles that do. Whether the
 * part emits is decided later, as for all segments (solve.c). White paint, highlights (bright from some directions
 * only) and sun patches are not split off (shining.h).
 *
 * Limits: triangles are not cut, so a lit part of one is not found; nor is a screen darker than white paper in its
 * place. Sunlight of an unobserved sun, through an opening that the mesh lacks, looks like an emitter. */
#ifndef UNBAKE_LIGHT_DECISION_SPLIT_H
#define UNBAKE_LIGHT_DECISION_SPLIT_H

#include <stddef.h>
#include <stdint.h>

#include "server/capture/views.h"
#include "server/state/reconstruction.h"

/* The segments that hold bright parts: parts are the new segments [old_count, r->segments.count). */
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
