/* environment.h -- distant light, measured where photographs look out of the room.
 *
 * A pixel that meets no surface (views_open) shows light from so far away that only its direction counts. All such
 * pixels of the training photographs make a latitude-longitude map in the layout of latlong.h, which then lights the
 * room through its openings.
 *
 * Limits. What an opening shows is taken to be infinitely far. Where it is near (an unscanned wall seen through a hole
 * of the mesh), photographs from different places disagree about a direction; the map holds their median, and `spread`
 * is their disagreement. Where frames saturate, others of shorter exposures tell of it, if there are any
 * (environment_bounds.h). Unseen directions are filled in smoothly from their surroundings (fill.h), which is a guess;
 * a sun among them is searched for by what it lights (sun_find.h). Through the gaps of a scan and beside its rounded
 * edges photographs show the room itself: that lights what it lights, but nothing is filled in from it. */
#ifndef UNBAKE_CAPTURE_DISTANT_ENVIRONMENT_H
#define UNBAKE_CAPTURE_DISTANT_ENVIRONMENT_H

#include <stdbool.h>

#include "common/image.h"
#include "common/json.h"
#include "common/vec.h"

/* Bounds of the map's width, pixels: 5.6 degrees a pixel, ten suns across, as coarse as light through windows allows;
 * .18 degrees, a third of the sun, beyond which memory grows and nothing is lit differently. */
#define ENVIRONMENT_MIN_WIDTH 64   /* +25 %: no change */
#define ENVIRONMENT_MAX_WIDTH 2048 /* +25 %: no change */

/* Halves of the sphere, above the horizon and below it: sky and ground are lit differently. */
#define ENVIRONMENT_HALVES 2

struct environment {
    struct image map;        /* R G B radiance; height = width / 2; no pixels when nothing was seen; owned */
    struct image confidence; /* of the same size: `count` of photographs that show the direction, 0 where it was filled
                              * in, and `spread`, the standard deviation of log radiance among them; owned */
    bool *is_bound;          /* [height][width] all of them saturate there: the map holds a lower bound; NULL after
                              * sun_draw; owned */
    float rim_angle;         /* radians: how far the rims of openings may be off */
    rgb brightened[ENVIRONMENT_HALVES]; /* factors by which lower bounds were since (light_estimate.h) */
    size_t photograph_count;            /* with open pixels */
    double seen_share;                  /* of the sphere */
    double saturated_share;             /* of what was seen: directions of which only a lower bound is known */
    double median_spread;               /* over directions that two photographs or more show */
    double seen_luminance, luminance;   /* means over what was seen and over the sphere */
};

/* A black map of `width` x `width` / 2 of which nothing was seen, and one of the least width. */
void environment_make_empty(struct environment *e, uint32_t width);
void environment_make_unseen(struct environment *e);
void environment_release(struct environment *e);

/* The cell of the map, row * width + column, in which a unit direction lies. */
size_t environment_cell(const struct environment *e, vec3 direction);

/* Whether a photograph shows a unit direction. */
bool environment_is_seen(const struct environment *e, vec3 direction);

/* Whether its radiance is measured: a photograph shows it and is not saturated there. */
bool environment_is_measured(const struct environment *e, vec3 direction);

/* Solid angle of a cell in a row. */
double environment_cell_angle(const struct environment *e, size_t row);

/* Unit direction of the centre of a pixel of the map. */
vec3 environment_direction(const struct environment *e, size_t column, size_t row);

/* Of the map's pixels, by number row * width + column: how many there are, their directions, radiances, and whether a
 * photograph shows them. */
static inline size_t environment_pixel_count(const struct environment *e) {
    return (size_t)e->map.width * e->map.height;
}
static inline vec3 environment_pixel_direction(const struct environment *e, size_t pixel) {
    return environment_direction(e, pixel % e->map.width, pixel / e->map.width);
}
static inline rgb environment_pixel_radiance(const struct environment *e, size_t pixel) {
    const float *p = e->map.pixel + 3 * pixel;
    return rgb_make(p[0], p[1], p[2]);
}
static inline bool environment_pixel_is_seen(const struct environment *e, size_t pixel) {
    return e->confidence.pixel[2 * pixel] > 0.0f;
}

/* [height][width] which pixels tell what is around them: those that are seen, farther from all that is not than
 * rim_angle; all that are seen where none is. The caller's. */
bool *environment_known(const struct environment *e);

/* Fills in the pixels that are not seen. */
void environment_fill(struct environment *e);

/* The half of a unit direction. */
static inline size_t environment_half(vec3 direction) { return direction.y < 0.0f; }

/* Multiplies the lower bounds of each half by its factor, for each channel, and fills in unseen directions again. */
void environment_brighten(struct environment *e, const rgb factor[ENVIRONMENT_HALVES]);

/* Recomputes the means, after filled-in directions changed. */
void environment_update_figures(struct environment *e);

/* The figures as an object for the report; the caller's. */
cJSON *environment_figures(const struct environment *e);

#endif
