/* height_fit.h -- least-squares plane or paraboloid through vertices of a mesh.
 *
 * The height over a local frame is a polynomial in the frame's coordinates: 3 terms (1, x, y) or 6 (with x^2, xy,
 * y^2). */
#ifndef UNBAKE_SCENE_HEIGHT_FIT_H
#define UNBAKE_SCENE_HEIGHT_FIT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/vec.h"

#define HEIGHT_PLANE 3 /* terms */
#define HEIGHT_PARABOLOID 6

struct height_frame {
    vec3 centre, u, v, normal; /* metres; orthonormal */
    double unit;               /* root mean square distance of the vertices from the centre, m */
};

struct height_fit {
    size_t terms;
    double coefficient[HEIGHT_PARABOLOID];               /* of heights in metres over coordinates in `unit` */
    double factor[HEIGHT_PARABOLOID][HEIGHT_PARABOLOID]; /* Cholesky factor of the normal equations */
    double residual_squares;                             /* sum of squared residuals, m^2 */
};

/* Frame centred at the mean of position[vertex[0..count)], count > 0; `normal` need not be unit. */
void height_frame_init(struct height_frame *f, vec3 normal, const vec3 *position, const uint32_t *vertex, size_t count);

/* Height of a point over the frame, metres. */
static inline double height_over(const struct height_frame *f, vec3 at) {
    return (double)vec3_dot(f->normal, vec3_sub(at, f->centre));
}

/* False when there are too few vertices or they are degenerate. */
bool height_fit(struct height_fit *fit, size_t terms, const struct height_frame *f, const vec3 *position,
                const uint32_t *vertex, size_t count);

/* Height of the fitted surface at the coordinates of `at`, metres. */
double height_fitted(const struct height_fit *fit, const struct height_frame *f, vec3 at);

/* Variance of height_fitted, as a multiple of the variance of a vertex. */
double height_variance(const struct height_fit *fit, const struct height_frame *f, vec3 at);

#endif
