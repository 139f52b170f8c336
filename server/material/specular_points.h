/* specular_points.h -- sample points of all segments, by all threads.
 *
 * A segment's texels are tried in an order of their own until enough fulfil the criteria, which are relaxed where too
 * few do: first pixels nearer to edges, then smaller patches. In each round every segment tries as many as it still
 * lacks, and all of these are observed at once: a large segment keeps as many threads busy as many small ones, and its
 * points are those of one try after the other. */
#ifndef UNBAKE_MATERIAL_SPECULAR_POINTS_H
#define UNBAKE_MATERIAL_SPECULAR_POINTS_H

#include <stdbool.h>

#include "common/parallel.h"
#include "server/material/specular_misfit.h"
#include "server/material/specular_observation.h"

/* Points of one segment. */
struct segment_points {
    struct specular_points points; /* with room for [points wanted] samples */
    bool is_observed;              /* its material can be fitted; otherwise these points only tell whether it is dark */
};

/* Fills points[segment_count], whose samples have their room; emitters, whose own light hides what they reflect, get
 * none. */
void specular_points_find(const struct specular_observer *observer, const bool *is_emitter,
                          struct segment_points *points, struct parallel *pool);

#endif
