/* pose_costs.h -- how well photographs agree at held-out tracks (pose_solver.h), by which poses are judged. */
#ifndef UNBAKE_CAPTURE_POSE_COSTS_H
#define UNBAKE_CAPTURE_POSE_COSTS_H

#include "server/capture/poses/pose_solver.h"

/* Standard errors by which all photographs agree better, for one decision about all of them. */
#define POSE_COSTS_SIGNIFICANCE 3.0

static inline size_t pose_costs_count(const struct pose_solver *s) {
    return (s->track_count + POSE_HELD_OUT_EVERY - 1) / POSE_HELD_OUT_EVERY;
}

/* Robust cost of each held-out track with all frames where they are now and offsets fitted to that; NAN: none. */
void pose_costs(struct pose_solver *s, double *cost);

struct validation pose_costs_compare(const double *before, const double *now, size_t count);

#endif
