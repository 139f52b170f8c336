/* calibrate_blur.h -- photographs blurred by motion or focus, to be trusted less.
 *
 * At each track the squared slope of a photograph, along two directions, is compared with the median
 * of the others that see the place. Over an edge that is blurred with standard deviation s the sum
 * of squared slopes falls as 1 / s, so the ratio of a photograph's sum to its neighbours' tells how
 * much wider its blur is, in the direction where it is widest. What stands out is written to
 * photograph.blur_px, by which views weigh it less. Tracks lie where their own photograph has the
 * strongest slopes, which therefore is not judged by them. */
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
