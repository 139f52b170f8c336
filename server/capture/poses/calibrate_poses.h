/* calibrate_poses.h -- corrects camera poses by some pixels where that makes photographs agree.
 *
 * A photograph is moved (six degrees of freedom) so that at places of strong texture it shows what the other
 * photographs show there (Lucas & Kanade 1981; robust Gauss-Newton over all photographs at once, coarse to fine). The
 * mesh stays fixed. A correction is kept only when it is large enough to matter and the photograph agrees significantly
 * better at held-out tracks; otherwise the pose stays exactly as it was. Where many are moved, or all together agree
 * significantly better, and corrections are common to neighbours in the order of the photographs, those that show too
 * little follow (pose_walk.h). */
#ifndef UNBAKE_CAPTURE_POSES_CALIBRATE_POSES_H
#define UNBAKE_CAPTURE_POSES_CALIBRATE_POSES_H

#include "common/parallel.h"
#include "server/capture/tracks.h"
#include "server/scene/scene.h"

struct poses_found {
    bool is_drift; /* they follow a walk */
    size_t moved_count;
    double shift_px;             /* rms over the moved photographs, pixels */
    size_t held_out_moved_count; /* held-out photographs, and their rms, pixels */
    double held_out_shift_px;
    float *shift; /* [train_count] rms over a photograph's tracks, pixels; 0 where it was not moved; owned */
};

/* Moves the cameras of training photographs and, where any is moved, those of held-out ones (held_out_poses.h). The
 * tracks stay valid, but the depth edges in `views` are then those of the old poses. The same for any number of
 * threads. */
void calibrate_poses(struct scene *scene, const struct tracks *tracks, struct parallel *pool,
                     struct poses_found *found);
void poses_found_release(struct poses_found *found);

#endif
