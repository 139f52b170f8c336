/* pyramid.h -- a photograph as log luminance at several scales, for comparison with other photographs.
 *
 * Logarithms turn a wrong exposure into an offset. Level 0 is the photograph (halved as often as the pixel budget
 * asks), smoothed by the binomial 1 2 1 in both directions, so that positions between pixels are not much smoother than
 * those on a pixel; each further level has half the size, down to no pixel for small pictures. Unusable pixels (masked,
 * saturated, nearly black) and those within a few pixels of a depth edge are NaN, as is everything smoothed with them.
 * Edges where surfaces meet without depth difference lie on the surfaces and are kept. */
#ifndef UNBAKE_CAPTURE_PYRAMID_H
#define UNBAKE_CAPTURE_PYRAMID_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "server/scene/photograph.h"

/* The coarsest has an eighth of the width: 80 pixels of the 640 of a level 0 (tracks.c), just above what is used
 * (COARSEST_PX of calibrate_poses.c). */
#define PYRAMID_LEVELS 4 /* to 5: no change */

struct pyramid {
    float scale; /* pixels of level 0 per pixel of the photograph: 1, 1/2, 1/4, ... */
    uint32_t width[PYRAMID_LEVELS], height[PYRAMID_LEVELS];
    float *value[PYRAMID_LEVELS]; /* [height][width] of each; owned */
};

/* `shows` [height][width] is the photograph's views.shows; NULL: unknown, and no edges are masked. Level 0 has at most
 * `pixels` pixels. `floor` is the radiance added before the logarithm. */
void pyramid_make(struct pyramid *p, const struct photograph *photo, const uint8_t *shows, size_t pixels, float floor);
void pyramid_release(struct pyramid *p);

/* Bilinear value at the photograph's position (x, y), NaN where unknown. */
float pyramid_value(const struct pyramid *p, int level, float x, float y);

/* The same and its derivative by x and y, per pixel of the photograph. False where unknown. */
bool pyramid_gradient(const struct pyramid *p, int level, float x, float y, float *value, float gradient[2]);

#endif
