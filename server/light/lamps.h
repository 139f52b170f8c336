/* lamps.h -- lights whose radiance photographs do not tell, and how bright they must be by what they light.
 *
 * Places all over the room are lit by what is known, and by these lamps: those that no photograph shows
 * (lamp_find.h), and those at which every photograph saturates (saturated_light.h). Each in turn, the others being as
 * bright as they are by now, gets the radiance with which the places are least odd (missing_light.h). Segments at which
 * photographs saturate and which are alike, a row of bulbs or panels, are one lamp: what they light hardly tells
 * which of them it is. Which lamps there are is not decided here. */
#ifndef UNBAKE_LIGHT_LAMPS_H
#define UNBAKE_LIGHT_LAMPS_H

#include "server/capture/views.h"
#include "server/light/missing_light.h"
#include "server/light/segment_light.h"
#include "server/state/reconstruction.h"

#define LAMPS_MOST 16
/* What all is white to, for all one knows of the light by now: reflected light is read off few rays. */
#define LAMPS_WHITEST 1.2f
/* In the place of a segment: the directions of the environment in which all photographs saturate, and those that none
 * shows, which were filled in from them. Its radiance is a factor to what the map has. */
#define LAMPS_SKY UINT32_MAX

/* Segments that are one lamp. */
#define LAMPS_ALIKE_MOST 16

struct lamp {
    size_t segment_count;
    uint32_t segment[LAMPS_ALIKE_MOST];
    rgb radiance;
    rgb least;    /* what photographs tell */
    bool told[3]; /* by channel: it is no more than that */
    float *lit;   /* [places.count] what a white surface at each place shows of a radiance of 1; owned */
};

struct lamps {
    struct reconstruction *r; /* borrowed */
    float median_radiance;    /* of the room */
    struct segment_light light;
    struct light_places places;
    struct missing_light missing; /* of the places, as all lamps light them by now */
    bool *without;                /* [segment_count] lamps that the survey goes without; owned */
    size_t count;
    struct lamp lamp[LAMPS_MOST];
};

void lamps_init(struct lamps *l, struct reconstruction *r, const struct views *views);
void lamps_release(struct lamps *l);

/* Adds a segment of which photographs tell nothing; there must be room for it. After the survey it lights the places
 * from then on. */
struct lamp *lamps_add(struct lamps *l, uint32_t segment, rgb radiance);
/* Before the survey: a segment at which photographs saturate, as r->evidence has it, to a lamp that is alike or as
 * one of its own, for which there must be room; the sky at which they do. */
void lamps_add_bound(struct lamps *l, uint32_t segment);
void lamps_add_sky(struct lamps *l);
static inline bool lamps_is_sky(const struct lamp *lamp) { return lamp->segment[0] == LAMPS_SKY; }

/* Fills the places: what is known, as survey_init has it, and the lamps that were added. Dim places count less.
 * `shown` is as in light_places_init. */
void lamps_survey(struct lamps *l, const struct views *views, const struct light_field *field, const struct fused *shown);

/* Whether one looks out of the room from the places in directions that no photograph shows: the sky may as well be what
 * is missing there (unseen_light.h). */
bool lamps_is_open(const struct lamps *l);

/* By how much it should be brighter, and how much less odd places would be then. */
float lamps_missing(struct lamps *l, const struct lamp *lamp, double *explained);

/* Gives a lamp the radiance that explains most, no less than photographs tell. `missing` is to be renewed after it. */
void lamps_fit_one(struct lamps *l, struct lamp *lamp);
/* The same for the first `count` in turn, twice; renews `missing`. */
void lamps_fit_all(struct lamps *l, size_t count);

/* Makes r->evidence and r->environment of the first `count` what they are by now. */
void lamps_hand_over(const struct lamps *l, size_t count);

/* Whether there are lamps that were handed over. */
bool lamps_are_estimated(const struct reconstruction *r);

/* Fits all of them again, with what texels send out, those too that no photograph shows, as `field` has it; `shown` is as
 * in lamps_survey. Where that is NULL the sky is fitted again as well, and the factor by which it changes noted in
 * r->sky_factor. The world is without emitters after it. */
void lamps_refit(struct reconstruction *r, const struct views *views, const struct light_field *field,
                 const struct fused *shown);

/* Changes the environment, and the world's, by such a factor. */
void lamps_brighten_sky(struct reconstruction *r, rgb factor);

/* Adds the light of a lamp that is `lit` in places. */
void lamps_shine(struct light_places *places, rgb radiance);

#endif
