/* sun_blur.h -- the sun as photographs show it on a surface: they average over pixels, and its shadows are blurred. */
#ifndef UNBAKE_LIGHT_SUN_SUN_BLUR_H
#define UNBAKE_LIGHT_SUN_SUN_BLUR_H

#include "server/capture/views.h"
#include "server/gather/sun.h"

/* Visible fraction of the disc, averaged over what bilinear look-ups of the photographs that see the point, clean ones
 * unless there is none, gather around it in its tangent plane, each by its solid angle; at the point alone where none
 * sees it. 0 where the shading or geometric normal faces away from the sun. `key`: of its random numbers. */
float sun_blur_visibility(const struct sun *sun, const struct views *views, const struct surface_point *at,
                          uint32_t key);

#endif
