/* clip.h -- which pixels of 8-bit photographs are saturated, judged with their neighbourhood.
 *
 * Where a surface is about as bright as the clip value, noise takes some pixels over it and leaves others below. The
 * mean of those below is too dark, and a long exposure has the largest weight. So saturation is decided for the surface
 * around a pixel: where three tenths of the pixels that show it are saturated, all within the noise of the clip are;
 * where fewer are, none is, and a pixel at the clip reads as the clip value. Values farther below the clip than noise
 * reaches (black tiles between white ones) stay as they are. */
#ifndef UNBAKE_CAPTURE_CLIP_H
#define UNBAKE_CAPTURE_CLIP_H

#include "server/capture/noise.h"

/* Fills photograph.saturated of the 8-bit training photographs of `scene`, which are those of `views`. The same for any
 * number of threads. */
void clip_mark(struct scene *scene, const struct views *views, const struct noise *noise, struct parallel *pool);

#endif
