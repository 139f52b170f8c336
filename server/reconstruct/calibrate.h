/* calibrate.h -- self-calibration of the photographs, the last step of `prepare`.
 *
 * Unknown exposures are solved. With the setting `calibrate`, faults of the capture are estimated and, where the
 * evidence is clear, corrected: drift of exposure and white balance, vignette, tone curve (calibrate_light.h),
 * poses off by a few pixels (calibrate_poses.h), a mesh that lies beside all photographs (pose_registration.h), motion
 * blur (calibrate_blur.h). A capture without faults is not changed at all. */
#ifndef UNBAKE_RECONSTRUCT_CALIBRATE_H
#define UNBAKE_RECONSTRUCT_CALIBRATE_H

#include "server/capture/views.h"
#include "server/state/reconstruction.h"

/* Changes the photographs of r->scene, updates `views`, adds "calibration" to r->report and logs what was found. */
void calibrate(struct reconstruction *r, struct views *views, const struct reconstruct_hooks *hooks);

#endif
