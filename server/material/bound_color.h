/* bound_color.h -- base colour of texels that saturate in most photographs, which tell only a lower bound of it.
 *
 * Of a texel's base colour x, bounded by b, the expectation given b <= x <= white paint. Before the bound it is
 * either as the measured texels of its segment (normal, by channel, with the error that light may have between the
 * two places) or any paint's (uniform in the logarithm). The first is as likely as the segment is measured rather
 * than bounded: of a floor half of which lies in a saturated patch of sun the other half tells, a white reveal that
 * saturates all over has nothing to go by. */
#ifndef UNBAKE_MATERIAL_BOUND_COLOR_H
#define UNBAKE_MATERIAL_BOUND_COLOR_H

#include "server/material/measurement.h"
#include "server/scene/surface.h"

/* Replaces the values of those of measured[height][width] whose `bounds` say so; adds their variance to `mixing`. */
void bound_color_settle(const struct surface *surface, struct measurement *measured);

#endif
