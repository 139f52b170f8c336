/* held_out_poses.h -- poses of held-out photographs, which are as wrong as those of the others.
 *
 * Each is aligned on its own to the consensus of the training photographs at the tracks (pose_solver.h), which stays as
 * it is. A held-out photograph influences neither the consensus nor anything else that is reconstructed: only the place
 * at which it is compared with the room changes. */
#ifndef UNBAKE_CAPTURE_POSES_HELD_OUT_POSES_H
#define UNBAKE_CAPTURE_POSES_HELD_OUT_POSES_H

#include "common/parallel.h"
#include "server/capture/poses/pose_solver.h"
#include "server/scene/scene.h"

/* Moves the cameras of held-out photographs where that is significantly better; where the others drift, each starts
 * between its neighbours (pose_walk.h) and stays moved unless that is worse. From level `coarsest` to the finest. Of
 * the solver, whose frames must have their final poses, only the values of the current level are written. Returns the
 * number moved; *shift_px: their rms shift, pixels. */
size_t held_out_poses_align(struct scene *scene, struct pose_solver *s, int coarsest, struct parallel *pool,
                            double *shift_px);

#endif
