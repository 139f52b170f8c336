/* views.h -- which photographs see a surface point, and how cleanly.
 *
 * A pixel whose four corner rays meet another segment or a depth edge mixes two surfaces and is not clean; it is used
 * only where no photograph of a point is clean. A pixel whose corner rays and centre ray meet no surface shows distant
 * light (environment.h). In photographs above 1.6 megapixels that is asked of cells of some pixels each
 * (view_edges.c). Held-out photographs are never used. */
#ifndef UNBAKE_CAPTURE_VIEWS_H
#define UNBAKE_CAPTURE_VIEWS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/parallel.h"
#include "common/rng.h"
#include "server/render/accel.h"
#include "server/scene/scene.h"
#include "server/scene/segment.h"

#define VIEWS_PICK_MAX 64 /* views that views_pick returns at most; bounds its stack; +25 %: no change */
/* Stored value of 8-bit photographs below which a pixel tells little: 50 of a full well of 10^4 electrons, 14 % of shot
 * noise, and 2 % of rounding to 8-bit sRGB. */
#define VIEWS_NOISE_VALUE 0.005f /* +25 %: no change */

/* Class of a pixel: one surface; several with a depth edge; none (open); several that touch. */
enum { VIEWS_SURFACE, VIEWS_MIXED, VIEWS_OPEN, VIEWS_SEAM };

/* The class of a pixel that mixes surfaces in views.edge. */
#define VIEWS_EDGE 3

/* 8-bit hash of a segment, in views.owner. */
static inline uint8_t views_owner_mark(uint32_t segment) { return (uint8_t)(rng_mix32(segment) >> 24); }

struct views {
    const struct scene *scene;       /* borrowed */
    const struct segments *segments; /* borrowed */
    const struct accel *accel;       /* borrowed */
    size_t train_count;
    uint32_t *train;       /* training photographs: [train_count] indices into scene->photograph; owned */
    uint8_t **shows;       /* [train_count][height * width] class of the pixel, VIEWS_SURFACE ...; owned */
    uint8_t **edge;        /* [train_count][height * width] VIEWS_EDGE where the pixel mixes surfaces, less by one
                                 * for every pixel of distance, down to 0; owned */
    uint8_t **owner;       /* [train_count][height * width] hash of the segment seen; owned */
    float median_radiance; /* of the training pixels (mean of the channels) */
};

/* A photograph's view of a point. */
struct view {
    uint32_t train; /* index into views.train */
    float x, y;     /* image position, pixels */
    float weight;   /* solid angle per area of surface (cosine over squared distance) x photograph_weight */
};

/* Tells the scene's spill that the classes of `count` pixels of a row, from number `at` on, are looked at or written
 * next. */
void views_use(const struct views *v, uint32_t train, size_t at, size_t count);

void views_init(struct views *v, const struct scene *scene, const struct segments *segments, const struct accel *accel,
                struct parallel *pool);
void views_release(struct views *v);
/* Recomputes the pixel classes of training photograph `train`, after its camera moved. */
void views_update_edges(struct views *v, uint32_t train, struct parallel *pool);
/* Recomputes all of them, after the segments changed. */
void views_update_segments(struct views *v, const struct accel *accel, struct parallel *pool);
/* Recomputes the median, after exposures changed. */
void views_update_median(struct views *v);

/* Whether training photograph `train` sees the front of the point: frustum, facing, and a
 * visibility ray. */
bool views_sees(const struct views *v, uint32_t train, vec3 point, vec3 geometric_normal, struct view *view);

/* Its two parts: whether the point is in the frustum and faces the camera (fills `view`), and whether nothing occludes
 * it. */
bool views_faces(const struct views *v, uint32_t train, vec3 point, vec3 geometric_normal, struct view *view);
bool views_unoccluded(const struct views *v, uint32_t train, vec3 point, vec3 geometric_normal);

/* Lowers a view's weight among others of a texel of that many square metres to what it can tell of it: one over the
 * area of pixel and texel together. A look-up reads single pixels; of many that cover the texel it has one's noise. */
void views_weigh(const struct views *v, float texel_m2, struct view *view);

/* Unit direction from a point to the camera of training photograph `train`. */
vec3 views_direction(const struct views *v, uint32_t train, vec3 point);

/* views_edge: the greatest `edge` among the four pixels of a bilinear look-up at a point of the triangle.
 * views_edge_weight: the weight of that look-up, in (0, 1]: lenses and reconstruction filters spread light a pixel or
 * two over an edge. A pixel that shows another segment (the triangle's is too thin for it) counts as mixed. */
int views_edge(const struct views *v, const struct view *view, uint32_t triangle);
float views_edge_weight(const struct views *v, const struct view *view, uint32_t triangle);

/* Relative variance of a look-up with radiance `observed` due to light of other surfaces: grows with the brightness
 * around it, and is at most 1, since no more can have been added than is observed. Neighbouring look-ups share it: no
 * mean reduces it. */
float views_mixing(const struct views *v, const struct view *view, uint32_t triangle, rgb observed);

/* Whether all four pixels of a look-up at the view's position are clean. */
bool views_clean(const struct views *v, const struct view *view);

/* Whether all pixels of a look-up at a position, and all within `margin` pixels of them, are open (those outside the
 * picture do not count). */
bool views_open(const struct views *v, uint32_t train, float x, float y, int margin);

/* Up to `max` (at most VIEWS_PICK_MAX) photographs that see the point, in pseudo-random order by `key`; clean ones
 * only, unless there is none. Returns their number. */
size_t views_pick(const struct views *v, vec3 point, vec3 geometric_normal, uint32_t key, size_t max,
                  struct view *view);

#endif
