/* held_out_poses.h -- poses of held-out photographs, which are as wrong as those of others.
 *
 * Each is moved on its own until it shows tracks as those photographs see them that are reconstructed from
 * (pose_solver.h, whose looks are kept). It has no say in these, nor in anything else that is learned: only where it
 * is compared with the room is put right. */
#ifndef UNBAKE_CAPTURE_HELD_OUT_POSES_H
#define UNBAKE_CAPTURE_HELD_OUT_POSES_H

#include "common/parallel.h"
#include "server/capture/pose_solver.h"
#include "server/scene/scene.h"

/* Moves the cameras of held-out photographs, where that convinces; from level `coarsest` to the finest. Of the solver,
 * whose frames are where they belong, only what is computed for a level is written. Returns how many were moved, and the
 * rms over them of how far, in pixels. */
size_t held_out_poses_align(struct scene *scene, struct pose_solver *s, int coarsest, struct parallel *pool,
                            double *shift_px);

#endif
