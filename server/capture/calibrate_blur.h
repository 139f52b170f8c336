/* calibrate_blur.h -- finds photographs blurred by motion or focus, which then weigh less.
 *
 * At each track the squared slope of a photograph, along two directions, is compared with the median of the other
 * photographs that see it. For an edge blurred with standard deviation s the sum of squared slopes falls as 1 / s, so
 * the ratio of a photograph's sum to its neighbours' gives its blur relative to theirs, in the direction where it is
 * widest. Outliers get photograph.blur_px, by which views weigh them less. Tracks are chosen where their own photograph
 * has its strongest slopes, so that photograph is not judged by them. */
#ifndef UNBAKE_CAPTURE_CALIBRATE_BLUR_H
#define UNBAKE_CAPTURE_CALIBRATE_BLUR_H

#include "server/capture/tracks.h"
#include "server/scene/scene.h"

struct blur_found {
    size_t blurred_count;
    double blur_px; /* median over the blurred photographs */
};

/* Sets blur_px of training photographs, with the cameras as they are now. */
void calibrate_blur(struct scene *scene, const struct tracks *tracks, struct blur_found *found);

#endif
