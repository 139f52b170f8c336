/* calibrate.h -- the last step of `prepare`: what the photographs themselves tell about how they
 * were taken, before anything is learned from them about the room.
 *
 * Exposures that nobody told are solved. With the setting `calibrate` faults of the capture are
 * looked for and, where the evidence is clear, put right: exposure that drifts, white balance that
 * changes, a vignette (calibrate_light.h), poses off by a few pixels (calibrate_poses.h),
 * motion blur (calibrate_blur.h). A capture without faults is left exactly as it is. */
#ifndef UNBAKE_RECONSTRUCT_CALIBRATE_H
#define UNBAKE_RECONSTRUCT_CALIBRATE_H

#include "server/capture/views.h"
#include "server/state/reconstruction.h"

/* Changes the photographs of r->scene, brings `views` up to date, adds "calibration" to r->report
 * and says in the log what was found. */
void calibrate(struct reconstruction *r, struct views *views, const struct reconstruct_hooks *hooks);

#endif
