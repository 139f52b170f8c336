/* halves.h -- how noisy the mean of several photographs is, told by the photographs alone.
 *
 * Half of them less the others is free of what all of them show, and holds all in which they do not agree:
 * noise however it is distributed, poses that are off, highlights. Scaled to the variance that the mean should have it
 * is a draw of the mean's error. Neighbours that the same photographs show are parted in the same way, so
 * what correlates their errors correlates their draws. */
#ifndef UNBAKE_CAPTURE_HALVES_H
#define UNBAKE_CAPTURE_HALVES_H

#include <stdbool.h>

#include "server/capture/robust.h"

/* In which half a photograph is, 0 or 1, in one of HALVES_SPLITS ways to part them. */
#define HALVES_SPLITS 32
int halves_of(uint32_t source, int split);

/* Draws the error of the samples' mean by their weights. False, with `draw` as it was, where there is but one
 * source, or no noise is expected of any. */
bool halves_draw(const struct robust_sample *sample, size_t count, rgb *draw);

#endif
