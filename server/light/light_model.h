/* light_model.h -- the joint fit (joint_fit.h) of a room: its points, and the sources that may light them. */
#ifndef UNBAKE_LIGHT_LIGHT_MODEL_H
#define UNBAKE_LIGHT_LIGHT_MODEL_H

#include "server/capture/views.h"
#include "server/light/joint_fit.h"
#include "server/light/segment_light.h"

#define LIGHT_SATURATED_MOST 16 /* lamps of each kind */
#define LIGHT_HIDDEN_MOST 16
#define LIGHT_SEEN_MOST 24
#define LIGHT_LAMPS_MOST (LIGHT_SATURATED_MOST + LIGHT_HIDDEN_MOST + LIGHT_SEEN_MOST + ENVIRONMENT_HALVES)
#define LIGHT_ALIKE_MOST 16 /* segments that are one lamp */
_Static_assert(LIGHT_SATURATED_MOST *LIGHT_ALIKE_MOST + LIGHT_HIDDEN_MOST + ENVIRONMENT_HALVES <= ESTIMATED_MOST,
               "all lamps and the sky are reported");

/* A segment, several that look alike, or the saturated part of sky or ground, whose radiance is then a factor of the
 * map's. */
struct light_lamp {
    enum estimated_kind kind;
    size_t segment_count;
    uint32_t segment[LIGHT_ALIKE_MOST];
    rgb least;           /* observed radiance, a lower bound; 0 for hidden lamps */
    bool is_measured[3]; /* by channel: not saturated, so that `least` is the radiance */
    rgb radiance;        /* the estimate */
    float deviation;     /* standard deviation of its logarithm */
    size_t source;       /* in the fit */
    float *lit;          /* [points.count] column of the response; owned */
};

struct light_model {
    struct reconstruction *r; /* borrowed */
    float median_radiance;    /* of the room */
    struct segment_light light;
    struct light_sky sky;
    struct light_points points;
    bool *is_lamp; /* [segment_count] segments of lamps, which known light goes without; owned */
    size_t lamp_count;
    struct light_lamp lamp[LIGHT_LAMPS_MOST];
    struct joint_point *joint; /* [points.count] means of the channels; owned */
    struct joint_fit fit;
    double patches_alike;                       /* so many patches are worth one (joint_alike.h) */
    bool has_sky;                               /* unseen sky lights the points: */
    size_t first_cell;                          /* its sources in the fit, UNSEEN_CELLS of them */
    size_t first_guess;                         /* unseen surfaces: LIGHT_REGIONS factors of their fill */
    struct joint_tie tie[3 * UNSEEN_CELLS + 1]; /* between them, with saturated sky and ground, and of these */
};

/* Chooses the lamps at which photographs saturate, by r->evidence (emitters_observe), and the sky if it does. With
 * `again` those of r->light, and the hidden ones, instead. */
void light_model_init(struct light_model *m, struct reconstruction *r, const struct views *views, bool again);
void light_model_release(struct light_model *m);

/* Whether it has lamps or sky of unknown radiance. */
bool light_model_has_unknown(const struct light_model *m);

/* The saturated part of a half of the environment; NULL: none. */
const struct light_lamp *light_model_sky(const struct light_model *m, size_t half);

/* Makes points and fit. The arguments are those of survey_init and light_points_init. */
void light_model_survey(struct light_model *m, const struct views *views, const struct light_field *field,
                        const struct fused *observed);

/* Adds a hidden lamp of which `lit` is the column of the response; takes it over. Its radiance is of the fit's value. */
void light_model_add_hidden(struct light_model *m, uint32_t segment, const struct joint_source *source, float *lit);
/* Removes a hidden lamp. */
void light_model_remove_hidden(struct light_model *m, size_t lamp);

/* Measures m->patches_alike at the fit's values. */
void light_model_measure(struct light_model *m);

/* The prior of a hidden lamp. */
struct joint_source light_model_hidden_prior(const struct light_model *m);

/* Radiances of the lamps by channel, and deviations, from the fit's values. */
void light_model_finish(struct light_model *m);

#endif
