/* joint_alike.h -- how much less the patches of a joint fit say than independent ones would.
 *
 * Errors of neighbouring patches agree: the same texture, the same light that is not modelled. A source lights patches
 * smoothly, and the likelihood's slope by it is a sum of the patches' scores, weighted with its share w of their light,
 * whose variance is that of independent scores times
 *
 *     V = sum over p, q of w_p s_p w_q s_q / sum over p of (w_p s_p)^2    p, q of one segment, less than a radius apart
 *
 * (the estimator of Conley 1999 with a uniform kernel). Logarithms of likelihood ratios divided by V are those of a
 * model that knows, and so are variances multiplied by V. */
#ifndef UNBAKE_LIGHT_JOINT_ALIKE_H
#define UNBAKE_LIGHT_JOINT_ALIKE_H

#include "common/vec.h"
#include "server/light/joint_fit.h"

/* V of a source, or of all as if each lit everything evenly, at the sources' values; 1 at least. `position`
 * [point_count] of the points. */
#define JOINT_ALIKE_ALL SIZE_MAX
double joint_alike(const struct joint_fit *f, const vec3 *position, float radius_m, size_t source);

#endif
