/* light_model.h -- the joint fit (joint_fit.h) of a room: its points, and the sources that may light them. */
#ifndef UNBAKE_LIGHT_LIGHT_MODEL_H
#define UNBAKE_LIGHT_LIGHT_MODEL_H

#include "server/capture/views.h"
#include "server/light/joint_fit.h"
#include "server/light/light_lamp.h"
#include "server/light/sun/sunlit.h"

struct light_model {
    struct reconstruction *r; /* borrowed */
    struct light_lamps lamps;
    struct light_sky sky;
    struct sunlit sunlit; /* empty unless the sun is clipped */
    struct light_points points;
    struct joint_point *joint; /* [points.count] means of the channels; owned */
    float *albedo;             /* [segment_count] of what points show of a segment, at the priors; owned */
    struct joint_fit fit;
    double patches_alike;                /* so many patches are worth one (joint_alike.h) */
    bool has_sky;                        /* unseen sky, or what surrounds a scan, lights the points: */
    size_t first_cell;                   /* its sources in the fit, of each cell */
    size_t first_region;                 /* unseen surfaces: LIGHT_REGIONS factors of their fill */
    struct joint_tie tie[SKY_CELLS + 1]; /* of them to saturated sky and ground, and between these */
};

/* Chooses the lamps (light_lamps_choose), sky and ground where they saturate, and a sun that is clipped. */
void light_model_init(struct light_model *m, struct reconstruction *r, const struct views *views, bool again);
void light_model_release(struct light_model *m);

/* Makes points and fit. The arguments are those of survey_init and light_points_init. */
void light_model_survey(struct light_model *m, const struct views *views, const struct light_field *field,
                        const struct fused *observed);

/* Adds to the deviations of m->joint what a highlight may add to albedo, which makes dark surfaces less alike, and
 * fills m->albedo. How dark a segment is is judged once, by the sources' priors (light_model_survey calls it): were it
 * judged by the fit, light that makes all dark would explain anything. */
void light_model_allow_for_highlights(struct light_model *m);

/* Adds to column[points.count] the response of a hidden lamp: its own light and what unseen surfaces reflect of it. */
void light_model_respond_hidden(const struct light_model *m, uint32_t segment, float *column);

/* The median albedo of what is measured of each segment, at the fit's values. albedo[segment_count] stays as it is
 * where nothing is. */
void light_model_find_albedos(const struct light_model *m, float *albedo);

/* How many patches are worth one to the source that was added last, at the fit's values (joint_alike.h). */
double light_model_alike_last(const struct light_model *m);

/* Sets the errors of the fit's sources at their values, and that of all light: standard deviations by patches of which
 * so many are worth one, which is measured first. */
void light_model_find_errors(struct light_model *m);

#endif
