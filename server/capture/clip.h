/* clip.h -- which pixels of 8 bits saturate, told by those around them.
 *
 * Of a surface about as bright as a photograph can show, noise takes some pixels over the clip and leaves others below it.
 * The mean of those left is too dark, and as a long exposure counts for most elsewhere, it would there, too. Whether a
 * surface is beyond the clip is therefore asked of all pixels around that show it, and not of each by itself: where
 * three tenths of them saturate, all do that noise may have left below; where fewer do, none does, and a pixel at the
 * clip reads as the clip. What is farther below the clip than noise goes, black tiles between white ones, stays as it is. */
#ifndef UNBAKE_CAPTURE_CLIP_H
#define UNBAKE_CAPTURE_CLIP_H

#include "server/capture/noise.h"

/* Fills photograph.white of the photographs of `scene`, which are those of `views`, that are of 8 bits and not held out.
 * The same for any number of threads. */
void clip_mark(struct scene *scene, const struct views *views, const struct noise *noise, struct parallel *pool);

#endif
