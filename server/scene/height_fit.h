/* height_fit.h -- the plane or the paraboloid through some vertices of a mesh, by least squares.
 *
 * Their heights over a frame are a polynomial of their places in it: of three terms (1, x, y) or of six (x^2, xy, y^2 as
 * well). */
#ifndef UNBAKE_SCENE_HEIGHT_FIT_H
#define UNBAKE_SCENE_HEIGHT_FIT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/vec.h"

#define HEIGHT_PLANE 3 /* terms */
#define HEIGHT_PARABOLOID 6

struct height_frame {
    vec3 centre, u, v, normal; /* metres; unit, at right angles */
    double unit;               /* root of the vertices' mean square distance from the centre, m */
};

struct height_fit {
    size_t terms;
    double by[HEIGHT_PARABOLOID];                        /* heights in metres, places in units */
    double factor[HEIGHT_PARABOLOID][HEIGHT_PARABOLOID]; /* Cholesky's, of the normal equations */
    double squares;                                      /* of what is left, summed, m^2 */
};

/* Around the mean of position[vertex[0..count)], count > 0; `normal` need not be unit. */
void height_frame_init(struct height_frame *f, vec3 normal, const vec3 *position, const uint32_t *vertex, size_t count);

/* metres along the normal */
static inline double height_over(const struct height_frame *f, vec3 at) {
    return (double)vec3_dot(f->normal, vec3_sub(at, f->centre));
}

/* False where the vertices are too few, or lie so that they do not tell. */
bool height_fit(struct height_fit *fit, size_t terms, const struct height_frame *f, const vec3 *position,
                const uint32_t *vertex, size_t count);

/* What the fit says of the height over the place of `at`, metres. */
double height_fitted(const struct height_fit *fit, const struct height_frame *f, vec3 at);

/* The variance of that, over that of a vertex. */
double height_variance(const struct height_fit *fit, const struct height_frame *f, vec3 at);

#endif
