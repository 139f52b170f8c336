/* lamps.h -- radiance of lamps that photographs do not measure, from the surfaces that they light.
 *
 * These are lamps that no photograph shows (lamp_find.h) and lamps at which every photograph saturates
 * (saturated_light.h). By coordinate descent each gets the radiance of least misfit over sample places of the room
 * (missing_light.h). Similar saturated segments, a row of bulbs or panels, share one radiance, since the places hardly
 * separate them. Which lamps there are is decided elsewhere. */
#ifndef UNBAKE_LIGHT_LAMPS_H
#define UNBAKE_LIGHT_LAMPS_H

#include "server/capture/views.h"
#include "server/light/missing_light.h"
#include "server/light/segment_light.h"
#include "server/state/reconstruction.h"

#define LAMPS_MOST 16
/* Albedo above this is implausible; loose because indirect light is noisy. */
#define LAMPS_WHITEST 1.2f
/* In place of a segment: the saturated directions of the environment, and the unobserved ones filled in from them. The
 * radiance of such a lamp is a factor of the map's. */
#define LAMPS_SKY UINT32_MAX

/* Segments that are one lamp. */
#define LAMPS_ALIKE_MOST 16

struct lamp {
    size_t segment_count;
    uint32_t segment[LAMPS_ALIKE_MOST];
    rgb radiance;
    rgb least;           /* observed radiance, a lower bound */
    bool is_measured[3]; /* by channel: not saturated, so that `least` is the radiance */
    float *lit;          /* [places.count] Lambert radiance at albedo 1 by a lamp of radiance 1; owned */
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

/* Adds a segment that no photograph shows; there must be room for it. If added after the survey it lights the places
 * from then on. */
struct lamp *lamps_add(struct lamps *l, uint32_t segment, rgb radiance);
/* Before the survey: a segment at which photographs saturate, as r->evidence has it, to a lamp that is alike or as
 * one of its own, for which there must be room; the sky at which they do. */
void lamps_add_bound(struct lamps *l, uint32_t segment);
void lamps_add_sky(struct lamps *l);
static inline bool lamps_is_sky(const struct lamp *lamp) { return lamp->segment[0] == LAMPS_SKY; }

/* Makes the places (survey_init, light_places_init), lit by known light and by the lamps added so far. Dim places have
 * a lower weight. */
void lamps_survey(struct lamps *l, const struct views *views, const struct light_field *field,
                  const struct fused *shown);

/* Whether places see out of the room in unobserved directions: missing light may then be sky (unseen_light.h). */
bool lamps_is_open(const struct lamps *l);

/* Missing radiance of a lamp, and the reduction of misfit by it. */
float lamps_missing(struct lamps *l, const struct lamp *lamp, double *explained);

/* Sets a lamp to the radiance of least misfit, at least its observed one. `missing` must be renewed after it. */
void lamps_fit_one(struct lamps *l, struct lamp *lamp);
/* The same for the first `count` in turn, twice; renews `missing`. */
void lamps_fit_all(struct lamps *l, size_t count);

/* Makes r->evidence and r->environment of the first `count` what they are by now. */
void lamps_hand_over(const struct lamps *l, size_t count);

/* Whether there are lamps that were handed over. */
bool lamps_are_estimated(const struct reconstruction *r);

/* Fits all of them again with the outgoing radiance of `field`, which unobserved texels have too; `shown` is as in
 * lamps_survey. With NULL the sky is fitted again as well, and the factor of its change is stored in r->sky_factor.
 * Leaves the world without emitters. */
void lamps_refit(struct reconstruction *r, const struct views *views, const struct light_field *field,
                 const struct fused *shown);

/* Changes the environment, and the world's, by such a factor. */
void lamps_brighten_sky(struct reconstruction *r, rgb factor);

/* Adds the light of a lamp that is `lit` in places. */
void lamps_shine(struct light_places *places, rgb radiance);

#endif
