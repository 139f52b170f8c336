/* light_lamp.h -- the lamps of the joint fit (light_model.h), and the saturated sky and ground: which segments they
 * are, what is known of their radiance, and what they send to points. */
#ifndef UNBAKE_LIGHT_LIGHT_LAMP_H
#define UNBAKE_LIGHT_LIGHT_LAMP_H

#include "server/light/joint_model.h"
#include "server/light/segment_light.h"
#include "server/state/estimated_light.h"

#define LIGHT_MAX 16      /* saturated lamps; hidden ones; segments that are one lamp */
#define LIGHT_SEEN_MAX 24 /* lamps that are seen */
#define LIGHT_OPENINGS_MAX 14
#define LIGHT_LAMPS_MAX (2 * LIGHT_MAX + LIGHT_SEEN_MAX + LIGHT_OPENINGS_MAX + ENVIRONMENT_HALVES + 1)
_Static_assert(LIGHT_MAX *LIGHT_MAX + LIGHT_MAX + LIGHT_OPENINGS_MAX + ENVIRONMENT_HALVES <= ESTIMATED_MAX,
               "all lamps and the sky are reported");

/* A segment, several that look alike, the saturated part of sky or ground, whose radiance is then a factor of the
 * map's, or the sun, of its strength. */
struct light_lamp {
    enum estimated_kind kind;
    size_t segment_count;
    uint32_t segment[LIGHT_MAX];
    rgb least;           /* observed radiance, a lower bound; 0 for hidden lamps and openings */
    bool is_measured[3]; /* by channel: not saturated, so that `least` is the radiance */
    rgb radiance;        /* the estimate */
    float deviation;     /* standard deviation of its logarithm */
    size_t source;       /* in the fit */
    float *column;       /* [point count] column of the response; owned */
};

struct light_lamps {
    const struct reconstruction *r; /* borrowed */
    float median_radiance;          /* of the room */
    struct segment_light light;
    bool *is_lamp;      /* [segment_count] segments of lamps, which known light goes without; owned */
    bool left_some_out; /* more saturate than there is room for */
    size_t count;
    struct light_lamp lamp[LIGHT_LAMPS_MAX];
};

void light_lamps_init(struct light_lamps *l, const struct reconstruction *r, float median_radiance);
void light_lamps_release(struct light_lamps *l);

/* The saturated part of a half of the environment: adds it; the one that there is, or NULL. */
void light_lamps_add_half(struct light_lamps *l, size_t half);
const struct light_lamp *light_lamps_half(const struct light_lamps *l, size_t half);

/* Adds the sun, of at least a strength (sunlit.h), and of the strength that it has by now; the one that there is, or
 * NULL. */
void light_lamps_add_sun(struct light_lamps *l, rgb least, rgb strength);
const struct light_lamp *light_lamps_sun(const struct light_lamps *l);

/* Adds the lamps at which photographs saturate, by r->evidence (emitters_observe), the largest first; with `again`
 * those of r->light, and the hidden ones, instead. And those that photographs measure. */
void light_lamps_choose(struct light_lamps *l, bool again);

/* Adds a hidden lamp. */
struct light_lamp *light_lamps_add_hidden(struct light_lamps *l, uint32_t segment);

/* Whether there are lamps or sky of unknown radiance. */
bool light_lamps_has_unknown(const struct light_lamps *l);

/* What is known of a lamp; of a hidden one. */
struct joint_source light_lamps_prior(const struct light_lamps *l, const struct light_lamp *lamp);
struct joint_source light_lamps_hidden_prior(const struct light_lamps *l);
/* Of light that comes in where a scan lacks surface, by a cell of the surround or an opening. */
struct joint_source light_lamps_opening_prior(const struct light_lamps *l);

/* Makes a lamp's column of the response. */
void light_lamps_respond(const struct light_lamps *l, struct light_lamp *lamp, const struct light_points *points);

#endif
