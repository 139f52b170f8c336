/* atlas_overlap.h -- which triangles of a plane lie over each other. */
#ifndef UNBAKE_SCENE_ATLAS_OVERLAP_H
#define UNBAKE_SCENE_ATLAS_OVERLAP_H

#include <stdbool.h>
#include <stddef.h>

struct flat_triangle {
    double x[3], y[3]; /* counter-clockwise */
};

/* Goes through the triangles in order and sets dropped[i] for each one that lies over an earlier
 * one that was not dropped; an overlap no deeper than `depth` is none. Returns how many. */
size_t overlap_mark_dropped(const struct flat_triangle *triangle, size_t count, double depth, bool *dropped);

#endif
