/* environment.h -- distant light, measured where photographs look out of the room.
 *
 * A pixel that meets no surface (views_open) shows light that comes from so far away that only its
 * direction counts. All such pixels of the training photographs make a latitude-longitude map in
 * the layout of latlong.h, which lights the room through its openings from then on.
 *
 * Limits. What an opening shows is taken to be infinitely far: where it is near (a wall that was
 * not scanned, seen through a hole of the mesh), photographs from different places disagree about
 * a direction; the map then holds their median, and `spread` says by how much they disagree.
 * A direction that is only seen by frames which saturate below what others tell of the sky counts as unseen.
 * Light is known only in the directions in which some photograph looks out; the rest is filled
 * in smoothly from its surroundings (fill.h) and is a guess, but for a sun, which is looked for by what it lights
 * (sun_find.h). */
#ifndef UNBAKE_CAPTURE_ENVIRONMENT_H
#define UNBAKE_CAPTURE_ENVIRONMENT_H

#include <stdbool.h>

#include "common/image.h"
#include "common/json.h"
#include "common/parallel.h"
#include "server/capture/views.h"

#define ENVIRONMENT_MIN_WIDTH 64
#define ENVIRONMENT_MAX_WIDTH 2048

struct environment {
    struct image map;        /* R G B radiance; height = width / 2; no pixels when nothing was seen; owned */
    struct image confidence; /* of the same size: `count` photographs that show the direction, 0 where
                              * it was filled in, and `spread`, the standard deviation of the logarithm
                              * of what they show; owned */
    bool *is_bound;          /* [height][width] all of them saturate there: the map holds a lower bound; NULL after
                              * sun_draw; owned */
    rgb brightened;          /* factor by which that was made brighter since (lamps.h) */
    size_t photograph_count; /* that look out */
    double seen_share;       /* of the sphere */
    double saturated_share;  /* of what was seen: directions of which only a lower bound is known */
    double median_spread;    /* over what two photographs or more show */
    double seen_luminance, luminance; /* means over what was seen and over the sphere */
};

/* The map has a column for each pixel that the median of the photographs which look out would need
 * to go around: its width is the largest power of two up to 2 pi x focal length, within the
 * limits above. Exposures must be known. *e is to be released in any case. False when no
 * photograph looks out anywhere. The same for any number of threads. */
bool environment_make(struct environment *e, const struct views *views, struct parallel *pool);
/* A black map of the least width of which nothing was seen. */
void environment_make_unseen(struct environment *e);
void environment_release(struct environment *e);

/* The cell of the map, row * width + column, in which a unit direction lies. */
size_t environment_cell(const struct environment *e, vec3 direction);

/* Whether a photograph shows what is in a unit direction. */
bool environment_is_seen(const struct environment *e, vec3 direction);

/* Whether a photograph tells how bright it is there: shows it, and does not saturate. */
bool environment_is_measured(const struct environment *e, vec3 direction);

/* Unit direction of the centre of a pixel of the map. */
vec3 environment_direction(const struct environment *e, size_t column, size_t row);

/* Makes what all photographs saturate at brighter, by channel, and fills in the rest from it. */
void environment_brighten(struct environment *e, rgb factor);

/* Takes the means anew, after what was filled in changed. */
void environment_update_figures(struct environment *e);

/* The figures as an object for the report; the caller's. */
cJSON *environment_figures(const struct environment *e);

#endif
