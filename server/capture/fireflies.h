/* fireflies.h -- single pixels that shine by chance.
 *
 * Of a path tracer's samples few find much light: in a pixel here and there they leave many times what it should show
 * (fireflies), and a sensor has hot pixels. Such a pixel can outweigh all other photographs of what it shows, if it is
 * of the sharpest one. It is told by the pixels around: it is far brighter than each of them and than noise explains.
 *
 * Pixels are marked and stay as they are; who measures surfaces leaves them out. A small lamp may look the same, so
 * emitters and distant light are told by all pixels. */
#ifndef UNBAKE_CAPTURE_FIREFLIES_H
#define UNBAKE_CAPTURE_FIREFLIES_H

#include "server/capture/noise.h"

/* Fills photograph.spark of the photographs of `scene`, which are those of `views`, that are not held out. The same for
 * any number of threads. */
void fireflies_mark(struct scene *scene, const struct views *views, const struct noise *noise, struct parallel *pool);

#endif
