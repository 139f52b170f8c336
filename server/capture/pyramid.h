/* pyramid.h -- a photograph as logarithms of its gray radiance, at some scales, for comparing
 * photographs with each other.
 *
 * Logarithms make a wrong exposure an offset. Level 0 is the photograph (halved as often as its
 * budget asks) smoothed by the binomial 1 2 1 in both directions, so that a place between pixels
 * is not much smoother than one on a pixel; each further level has half the size, of a small
 * picture no pixel at last. What a pixel does not tell (masked, saturated, nearly black) and what
 * lies within a few pixels of a depth edge is NaN, and so is what was smoothed with it. Where surfaces meet without one
 * behind the other a picture's edge lies on them, and is kept. */
#ifndef UNBAKE_CAPTURE_PYRAMID_H
#define UNBAKE_CAPTURE_PYRAMID_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "server/scene/photograph.h"

#define PYRAMID_LEVELS 5

struct pyramid {
    float scale;  /* pixels of level 0 per pixel of the photograph: 1, 1/2, 1/4, ... */
    uint32_t width[PYRAMID_LEVELS], height[PYRAMID_LEVELS];
    float *value[PYRAMID_LEVELS]; /* [height][width] of each; owned */
};

/* `shows` [height][width] is what views.shows says of the photograph; NULL: that is not known, and edges stay. Level 0
 * has at most `pixels` pixels. `floor` is the radiance that is added before the logarithm. */
void pyramid_make(struct pyramid *p, const struct photograph *photo, const uint8_t *shows, size_t pixels,
                  float floor);
void pyramid_release(struct pyramid *p);

/* The value at the photograph's place (x, y), NaN where there is none; bilinear. */
float pyramid_value(const struct pyramid *p, int level, float x, float y);

/* The same and its derivative by x and y, in units per pixel of the photograph. False where
 * one of them is not known. */
bool pyramid_gradient(const struct pyramid *p, int level, float x, float y, float *value, float gradient[2]);

#endif
