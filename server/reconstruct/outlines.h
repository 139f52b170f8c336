/* outlines.h -- how much of a re-render's error lies beside outlines: places where one surface ends before another.
 * There mesh and photographs must fit to the pixel, which shows whether poses and mesh are exact; elsewhere they need
 * not. */
#ifndef UNBAKE_RECONSTRUCT_OUTLINES_H
#define UNBAKE_RECONSTRUCT_OUTLINES_H

#include "common/image.h"
#include "common/parallel.h"
#include "server/render/accel.h"
#include "server/scene/camera.h"

/* Pixels from an outline that count as beside it: drift of poses and coarse meshes reach about so far at 640 x 480. */
#define OUTLINE_REACH 2

struct outline_error {
    double msre_part;   /* sum over the pixels beside outlines, over the number of all: a part of metrics_msre */
    double pixel_share; /* of the pixels that count, that are beside outlines */
};

/* Depth of what a camera sees at the middle of each pixel, [height][width], metres along the optical axis (of a
 * panorama the distance); infinite where it sees nothing. The caller's (mem_free). */
float *outlines_depth(struct accel *accel, const struct camera *camera, struct parallel *pool);

/* The photograph and its re-renders are as for metrics_msre, of the size of `depth`. NaN without pixels that count. */
struct outline_error outlines_measure(const float *depth, const struct image *photograph, const struct image *halves,
                                      double median_radiance);

/* Both: one ray for each pixel finds the outlines. */
struct outline_error outlines_of_view(struct accel *accel, const struct camera *camera, struct parallel *pool,
                                      const struct image *photograph, const struct image *halves,
                                      double median_radiance);

#endif
