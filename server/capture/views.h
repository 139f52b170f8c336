/* views.h -- which photographs see a surface point, and what they show there.
 *
 * A photograph is consulted only where it is clean: a pixel whose four corner rays meet another
 * segment or a depth edge mixes two surfaces, and its value belongs to neither. Where no
 * photograph of a point is clean the unclean ones are taken. A pixel whose corner rays and whose
 * centre's ray meet no surface at all shows distant light (environment.h). Held-out frames are
 * never used. */
#ifndef UNBAKE_CAPTURE_VIEWS_H
#define UNBAKE_CAPTURE_VIEWS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/parallel.h"
#include "server/render/accel.h"
#include "server/scene/scene.h"
#include "server/scene/segment.h"

#define VIEWS_PICK_MAX 64

/* What a pixel shows: one surface; several, one behind the other; nothing; several that meet there. */
enum { VIEWS_SURFACE, VIEWS_MIXED, VIEWS_OPEN, VIEWS_SEAM };

/* The class of a pixel that mixes surfaces in views.edge. */
#define VIEWS_EDGE 3

struct views {
    const struct scene *scene;  /* borrowed */
    const struct segments *segments; /* borrowed */
    const struct accel *accel;  /* borrowed */
    size_t train_count;
    uint32_t *train;            /* [train_count] photographs that may be used; owned */
    uint8_t **shows;            /* [train_count][height * width] VIEWS_SURFACE: one surface, ...; owned */
    uint8_t **edge;             /* [train_count][height * width] VIEWS_EDGE where the pixel mixes surfaces,
                                 * one less for every pixel further from such a one, down to 0; owned */
    uint8_t **owner;            /* [train_count][height * width] a mark of the segment seen; owned */
    float median_radiance;      /* of the training pixels (mean of the channels) */
};

/* What one photograph shows of a point. */
struct view {
    uint32_t train;  /* index into views.train */
    float x, y;      /* place in the picture, pixels */
    float weight;    /* solid angle per area of surface (cosine over squared distance) x photograph_weight */
};

void views_init(struct views *v, const struct scene *scene, const struct segments *segments,
                const struct accel *accel, struct parallel *pool);
void views_release(struct views *v);
/* Marks the pixels that mix surfaces anew, of training photograph `train`, after its camera moved. */
void views_update_edges(struct views *v, uint32_t train, struct parallel *pool);
/* Marks all of them anew, after the segments changed. */
void views_update_segments(struct views *v, const struct accel *accel, struct parallel *pool);
/* Takes the median anew, after exposures changed. */
void views_update_median(struct views *v);

/* Whether training photograph `train` sees the front of the point: frustum, facing, and a
 * visibility ray. */
bool views_sees(const struct views *v, uint32_t train, vec3 point, vec3 geometric_normal,
                struct view *view);

/* Its two halves: whether the point is in the frustum and faces the camera, which fills `view`; and whether nothing stands
 * between them. */
bool views_faces(const struct views *v, uint32_t train, vec3 point, vec3 geometric_normal, struct view *view);
bool views_unoccluded(const struct views *v, uint32_t train, vec3 point, vec3 geometric_normal);

/* Unit direction from a point to where training photograph `train` was taken. */
vec3 views_direction(const struct views *v, uint32_t train, vec3 point);

/* The greatest class of `edge` among the four pixels that a look-up at a place of the triangle reads,
 * and how far such a look-up is to be trusted, in (0, 1]: lenses and reconstruction filters carry
 * light a pixel or two beyond an edge. A pixel that shows another segment (the triangle's is too thin
 * for it) counts as one that mixes surfaces. */
int views_edge(const struct views *v, const struct view *view, uint32_t triangle);
float views_trust(const struct views *v, const struct view *view, uint32_t triangle);

/* Variance, as a share of what is shown squared, that light of other surfaces may have added to a look-up at a place
 * of the triangle that shows `shown`: the more, the brighter its surroundings are, but no more than all that is
 * shown. (So what looks dark beside light is dark.) Neighbouring look-ups share it: no mean takes it away. */
float views_mixing(const struct views *v, const struct view *view, uint32_t triangle, rgb shown);

/* Whether all four pixels that a look-up at the view's place reads are clean. */
bool views_clean(const struct views *v, const struct view *view);

/* Whether nothing but distant light is in the pixels that a look-up at a place reads and in all
 * within `margin` pixels of them (those outside of the picture do not count). */
bool views_open(const struct views *v, uint32_t train, float x, float y, int margin);

/* Up to `max` (at most VIEWS_PICK_MAX) photographs that see the point, in an order drawn by
 * `key`; clean ones only, unless there is none. Returns their number. */
size_t views_pick(const struct views *v, vec3 point, vec3 geometric_normal, uint32_t key, size_t max,
                  struct view *view);

#endif
