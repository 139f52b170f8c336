/* thumbnail.h -- a photograph as local contrast at low resolution, for comparison with other photographs.
 *
 * A thumbnail is at most THUMBNAIL_WIDTH pixels wide: poses that drift by ten pixels of a phone's picture drift by one
 * or two of it. Its values are differences of log luminance to the mean of the neighbourhood, which no exposure
 * changes, compressed to (-1, 1), so that a lamp's edge counts no more than a book's. */
#ifndef UNBAKE_CHECK_THUMBNAIL_H
#define UNBAKE_CHECK_THUMBNAIL_H

#include <stdint.h>

#include "server/scene/photograph.h"

#define THUMBNAIL_WIDTH 160 /* pixels; also the largest height; +25 %: no verdict, correlations -0.07 to +0.00 */

struct thumbnail {
    uint32_t width, height;
    float *value; /* [height][width] in (-1, 1), NAN where the photograph has no usable pixel; owned */
    float detail; /* share of the pixels that differ from their neighbourhood by more than THUMBNAIL_DETAIL and noise */
    float brightness; /* median luminance of the stored pixels */
};

#define THUMBNAIL_DETAIL 0.05f /* of the log luminance: 5 %, above the noise of averaged pixels; +25 %: no verdict */

void thumbnail_make(struct thumbnail *t, const struct photograph *photo);
void thumbnail_release(struct thumbnail *t);

/* Bilinear value at relative position (u, v) in [0, 1); 0 where a tap is unusable. */
float thumbnail_value(const struct thumbnail *t, float u, float v);

#endif
