/* fireflies.h -- isolated bright pixels of Monte Carlo or sensor noise.
 *
 * A path tracer finds some light by few samples, which leaves single pixels many times too bright (fireflies); a sensor
 * has hot pixels. In the sharpest photograph of a surface such a pixel can outweigh all others. It is far brighter than
 * each of its neighbours, and by more than noise explains.
 *
 * Pixels are marked, not changed; surfaces are measured without them. A small lamp may look the same, so emitters and
 * distant light are measured with all pixels. */
#ifndef UNBAKE_CAPTURE_FIREFLIES_H
#define UNBAKE_CAPTURE_FIREFLIES_H

#include "server/capture/noise.h"

/* Fills photograph.firefly of the training photographs of `scene`, which are those of `views`. The same for any number
 * of threads. */
void fireflies_mark(struct scene *scene, const struct views *views, const struct noise *noise, struct parallel *pool);

#endif
