/* split_half.h -- noise of the mean of several photographs, from split halves.
 *
 * The difference between the means of two halves cancels what all photographs share and keeps everything in which they
 * disagree: noise of any distribution, wrong poses, highlights. Scaled to the variance that the full mean should have
 * it is one draw of the mean's error. Texels seen by the same photographs are split in the same way, so correlated
 * errors have correlated draws. */
#ifndef UNBAKE_CAPTURE_SPLIT_HALF_H
#define UNBAKE_CAPTURE_SPLIT_HALF_H

#include <stdbool.h>

#include "server/capture/robust.h"

#define SPLIT_HALF_SPLITS 32 /* pseudo-random ones; +25 %: +0.01 dB */
/* Half of a photograph, 0 or 1, in split [0, SPLIT_HALF_SPLITS). */
int split_half_of(uint32_t source, int split);

/* Draws the error of the weighted mean of the samples. False, with *draw unchanged, where there is only one source or
 * no noise is expected. */
bool split_half_draw(const struct robust_sample *sample, size_t count, rgb *draw);

#endif
