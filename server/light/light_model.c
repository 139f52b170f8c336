/* light_model.c -- see light_model.h. */
#include "server/light/light_model.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "server/light/emitters.h"
#include "server/light/joint_alike.h"
#include "server/state/evidence.h"

/* Prior of a hidden lamp: the mean and the standard deviation of the logarithm of its radiance over the room's median.
 * Luminous panels and shades have 30 to 1,000 times the luminance of walls. */
#define LAMP_OVER_ROOM 100.0
#define LAMP_DEVIATION 1.5
/* Saturated lamps are brighter than their lower bound by this standard deviation of the logarithm. */
#define SATURATED_DEVIATION 2.0
/* Lamps that photographs measure: in pixels of their own, and in pixels that mix them with what is beside. */
#define SEEN_DEVIATION 0.1
#define MIXED_DEVIATION 0.3
/* Ground over sky: the mean and the standard deviation of the logarithm of the ratio of their radiances. Ground reflects .2
 * of what falls on it, houses .3 to .5; overcast sky is a third as bright at the horizon as above, and under a sun the
 * ground is as bright as the sky. */
#define GROUND_OVER_SKY 0.4
#define GROUND_DEVIATION 0.7
/* Unseen sky about its fill; where nothing is seen, about the room's median radiance; and between neighbouring cells. */
#define SKY_DEVIATION 0.7
#define SKY_DEVIATION_ALONE 2.0
#define SKY_SMOOTHNESS 0.5
/* Colour: standard deviation of the logarithm of a channel about the mean of the channels. Black bodies of 2,700 K and
 * 6,500 K are .5 off in blue, coloured lamps twice as much. */
#define COLOR_DEVIATION 1.0
#define MEASURED_DEVIATION 0.02 /* of a channel that does not saturate */
#define COLOR_STEPS 8
/* Errors of patches agree up to this distance, in edges of patches: about 1 m, as far as a lamp near a surface lights. */
#define ALIKE_EDGES 3.5f
/* What a highlight that is not known yet may add to albedo. */
#define HIGHLIGHT_ALBEDO 0.04f
/* Surfaces that no photograph shows about their fill, the mean of their segment or of the room. */
#define GUESS_DEVIATION 0.7
/* Greatest relative differences, of area and of observed radiance, of segments that look alike. */
#define ALIKE_AREA 0.02f
#define ALIKE_RADIANCE 0.1f
/* Of a lamp, by what the model lacks: the root mean square of errors of ten hidden lamps of the rooms for choices is .23,
 * nearly all of it upwards. */
#define SYSTEMATIC_DEVIATION 0.25

/* --- lamps ------------------------------------------------------------------------------------------------- */

static bool is_near(float a, float b, float share) { return fabsf(a - b) <= share * fmaxf(a, b); }

/* Whether a segment has the size, the observed radiance and the saturated channels of a lamp. */
static bool is_alike(const struct light_model *m, const struct light_lamp *lamp, uint32_t segment) {
    const struct emitter_evidence *e = &m->r->evidence[segment];
    if (lamp->kind != ESTIMATED_SATURATED || lamp->segment_count == LIGHT_ALIKE_MOST ||
        !is_near(m->light.area_m2[lamp->segment[0]], m->light.area_m2[segment], ALIKE_AREA))
        return false;
    for (int c = 0; c < 3; c++) {
        if (lamp->is_measured[c] == e->saturated[c] ||
            !is_near((&lamp->least.r)[c], (&e->observed.r)[c], ALIKE_RADIANCE))
            return false;
    }
    return true;
}

static void add_saturated(struct light_model *m, uint32_t segment) {
    const struct emitter_evidence *e = &m->r->evidence[segment];
    m->is_lamp[segment] = true;
    for (size_t i = 0; i < m->lamp_count; i++) {
        if (is_alike(m, &m->lamp[i], segment)) {
            m->lamp[i].segment[m->lamp[i].segment_count++] = segment;
            return;
        }
    }
    struct light_lamp *lamp = &m->lamp[m->lamp_count++];
    *lamp = (struct light_lamp){ESTIMATED_SATURATED, 1, {segment}, .least = e->observed, .radiance = e->radiance};
    for (int c = 0; c < 3; c++)
        lamp->is_measured[c] = !e->saturated[c];
}

static const enum estimated_kind kind_of_half[ENVIRONMENT_HALVES] = {ESTIMATED_SATURATED_SKY,
                                                                     ESTIMATED_SATURATED_GROUND};

static void add_sky(struct light_model *m, size_t half) {
    rgb by = m->r->environment.brightened[half];
    m->lamp[m->lamp_count++] = (struct light_lamp){kind_of_half[half], .radiance = rgb_gray(1.0f),
                                                   .least = rgb_make(1.0f / by.r, 1.0f / by.g, 1.0f / by.b)};
}

const struct light_lamp *light_model_sky(const struct light_model *m, size_t half) {
    for (size_t i = 0; i < m->lamp_count; i++) {
        if (m->lamp[i].kind == kind_of_half[half])
            return &m->lamp[i];
    }
    return NULL;
}

static void add_hidden(struct light_model *m, uint32_t segment, rgb radiance) {
    m->is_lamp[segment] = true;
    m->lamp[m->lamp_count++] = (struct light_lamp){ESTIMATED_HIDDEN, 1, {segment}, .radiance = radiance};
}

/* A segment, and its power. */
struct bright {
    uint32_t segment;
    double power;
};

static int by_power(const void *a, const void *b) {
    const struct bright *first = a, *second = b;
    if (first->power != second->power)
        return first->power < second->power ? 1 : -1;
    return (first->segment > second->segment) - (first->segment < second->segment);
}

static bool is_saturated(const struct emitter_evidence *e) {
    return e->is_seen && (e->saturated[0] || e->saturated[1] || e->saturated[2]);
}

/* Segments, of those that are saturated or are not, that outshine the room, most power first; *found is the caller's. */
static size_t sort_bright(const struct light_model *m, bool saturated, struct bright **found) {
    const struct reconstruction *r = m->r;
    size_t count = 0;
    *found = mem_array(r->segments.count + 1, sizeof **found);
    for (size_t i = 0; i < r->segments.count; i++) {
        const struct emitter_evidence *e = &r->evidence[i];
        bool is_bright = saturated || (e->is_seen && emitters_outshine(rgb_mean(e->radiance), m->median_radiance));
        if (is_saturated(e) == saturated && is_bright && !m->is_lamp[i])
            (*found)[count++] = (struct bright){(uint32_t)i, (double)(rgb_mean(e->radiance) * m->light.area_m2[i])};
    }
    qsort(*found, count, sizeof **found, by_power);
    return count;
}

static void choose_saturated(struct light_model *m) {
    struct bright *found;
    size_t count = sort_bright(m, true, &found);
    for (size_t i = 0; i < count && m->lamp_count <= LIGHT_SATURATED_MOST; i++)
        add_saturated(m, found[i].segment);
    mem_free(found);
}

/* Lamps that photographs measure: known, but for the error of that. */
static void choose_seen(struct light_model *m) {
    struct bright *found;
    size_t count = sort_bright(m, false, &found);
    for (size_t i = 0; i < count && i < LIGHT_SEEN_MOST && m->lamp_count < LIGHT_LAMPS_MOST - LIGHT_HIDDEN_MOST; i++) {
        const struct emitter_evidence *e = &m->r->evidence[found[i].segment];
        m->is_lamp[found[i].segment] = true;
        m->lamp[m->lamp_count++] = (struct light_lamp){ESTIMATED_SEEN,          1,
                                                       {found[i].segment},      .least = e->observed,
                                                       .radiance = e->observed, .is_measured = {true, true, true}};
    }
    mem_free(found);
}

static void choose_again(struct light_model *m) {
    const struct reconstruction *r = m->r;
    for (size_t i = 0; i < r->segments.count && m->lamp_count < LIGHT_LAMPS_MOST; i++) {
        if (r->evidence[i].is_unbounded)
            add_saturated(m, (uint32_t)i);
        else if (r->evidence[i].is_hidden)
            add_hidden(m, (uint32_t)i, r->evidence[i].radiance);
    }
}

void light_model_init(struct light_model *m, struct reconstruction *r, const struct views *views, bool again) {
    *m = (struct light_model){.r = r, .median_radiance = views->median_radiance};
    m->is_lamp = mem_calloc(r->segments.count + 1, sizeof *m->is_lamp);
    segment_light_init(&m->light, r);
    light_sky_init(&m->sky, &r->environment);
    if (r->environment.map.pixel && r->environment.saturated_share > 0.0 && !r->sky_is_fitted) {
        m->sky.estimates_bounds = true;
        for (size_t half = 0; half < ENVIRONMENT_HALVES; half++) {
            if (m->sky.bound_share[half] > 0.0)
                add_sky(m, half);
        }
    }
    if (again)
        choose_again(m);
    else
        choose_saturated(m);
    choose_seen(m);
}

bool light_model_has_unknown(const struct light_model *m) {
    bool any = false;
    for (size_t i = 0; i < m->lamp_count; i++)
        any = any || m->lamp[i].kind != ESTIMATED_SEEN;
    return any;
}

void light_model_release(struct light_model *m) {
    for (size_t i = 0; i < m->lamp_count; i++)
        mem_free(m->lamp[i].lit);
    joint_fit_release(&m->fit);
    mem_free(m->joint);
    light_points_release(&m->points);
    light_sky_release(&m->sky);
    segment_light_release(&m->light);
    mem_free(m->is_lamp);
    *m = (struct light_model){0};
}

/* --- the fit ----------------------------------------------------------------------------------------------- */

static struct joint_source prior_of(const struct light_model *m, const struct light_lamp *lamp) {
    struct joint_source source = light_model_hidden_prior(m);
    double least = fmax((double)rgb_mean(lamp->least), 1e-30);
    if (lamp->kind != ESTIMATED_HIDDEN)
        source = (struct joint_source){.mean = log(least), .deviation = SATURATED_DEVIATION, .least = log(least)};
    if (lamp->kind == ESTIMATED_SEEN) {
        bool is_mixed = m->r->evidence[lamp->segment[0]].only_mixed;
        source.deviation = is_mixed ? MIXED_DEVIATION : SEEN_DEVIATION;
        source.least = -INFINITY;
    }
    source.value = fmax(log(fmax((double)rgb_mean(lamp->radiance), 1e-30)), source.least);
    return source;
}

struct joint_source light_model_hidden_prior(const struct light_model *m) {
    double mean = log(LAMP_OVER_ROOM * fmax((double)m->median_radiance, 1e-20));
    return (struct joint_source){.mean = mean, .deviation = LAMP_DEVIATION, .least = -INFINITY, .value = mean};
}

/* The column of the response of a lamp. */
static void light_lamp(struct light_model *m, struct light_lamp *lamp) {
    lamp->lit = mem_calloc(m->points.count + 1, sizeof *lamp->lit);
    for (size_t k = 0; k < lamp->segment_count; k++)
        segment_light_add(&m->light, m->points.point, m->points.count, lamp->segment[k], SEGMENT_LIGHT_POINTS,
                          lamp->lit);
    for (size_t half = 0; half < ENVIRONMENT_HALVES; half++) {
        for (size_t i = 0; i < m->points.count && lamp->kind == kind_of_half[half]; i++)
            lamp->lit[i] = m->points.point[i].saturated[half];
    }
}

static void tie(struct light_model *m, size_t a, size_t b, double difference, double deviation) {
    m->tie[m->fit.tie_count++] = (struct joint_tie){a, b, difference, deviation};
}

/* The half whose seen directions the fill of a half continues: its own, or the other one if none of its own is seen. */
static size_t half_filled_from(const struct light_model *m, size_t half) {
    return m->sky.bound_share[half] < 0.0 ? 1 - half : half;
}

/* The fill continues what is seen: as far as that saturates, the fill is as much brighter as it is. */
static void add_cell(struct light_model *m, size_t k, const float *lit) {
    const struct environment *e = &m->r->environment;
    size_t half = half_filled_from(m, light_sky_half(k));
    const struct light_lamp *bound = light_model_sky(m, half);
    double fill = m->sky.fill[k], part = bound ? m->sky.bound_share[half] : 0.0;
    double mean = log(fmax(fill, 1e-3 * fmax((double)m->median_radiance, 1e-20)));
    double deviation = SKY_DEVIATION;
    if (!e->map.pixel)
        mean = log(fmax((double)m->median_radiance, 1e-20)), deviation = SKY_DEVIATION_ALONE;
    struct joint_source source = {.mean = mean, .deviation = deviation, .least = -INFINITY, .value = mean};
    if (bound) {
        source.deviation = deviation / sqrt(fmax(1.0 - part, 0.01));
        tie(m, m->first_cell + k, bound->source, mean, deviation / sqrt(part));
    }
    joint_fit_add(&m->fit, &source, lit);
}

/* By the radiances of saturated sky and ground. */
static void tie_ground(struct light_model *m) {
    const struct light_lamp *sky = light_model_sky(m, 0), *ground = light_model_sky(m, 1);
    double ratio = GROUND_OVER_SKY * m->sky.bound_radiance[0] / m->sky.bound_radiance[1];
    if (sky && ground)
        tie(m, ground->source, sky->source, log(ratio), GROUND_DEVIATION);
}

static void add_cells(struct light_model *m) {
    float *lit = mem_calloc(m->points.count + 1, sizeof *lit);
    m->first_cell = m->fit.source_count;
    m->has_sky = true;
    for (size_t k = 0; k < UNSEEN_CELLS; k++) {
        for (size_t i = 0; i < m->points.count; i++)
            lit[i] = m->points.point[i].sky ? m->points.point[i].sky[k] : 0.0f;
        add_cell(m, k, lit);
    }
    for (size_t k = 0; k < UNSEEN_CELLS; k++) {
        size_t below = light_sky_below(k);
        tie(m, m->first_cell + k, m->first_cell + light_sky_right(k), 0.0, SKY_SMOOTHNESS);
        if (below < UNSEEN_CELLS)
            tie(m, m->first_cell + k, m->first_cell + below, 0.0, SKY_SMOOTHNESS);
    }
    mem_free(lit);
}

static float guess_mean(const struct light_point *p, size_t region) {
    const float *g = p->guessed + 3 * region;
    return (g[0] + g[1] + g[2]) / 3.0f;
}

/* What surfaces send that no photograph shows, by region, as a factor of their fill. */
static void add_guesses(struct light_model *m) {
    float *lit = mem_calloc(m->points.count + 1, sizeof *lit);
    const struct joint_source source = {.deviation = GUESS_DEVIATION, .least = -INFINITY};
    m->first_guess = m->fit.source_count;
    for (size_t k = 0; k < LIGHT_REGIONS; k++) {
        for (size_t i = 0; i < m->points.count; i++)
            lit[i] = m->points.point[i].guessed ? guess_mean(&m->points.point[i], k) : 0.0f;
        joint_fit_add(&m->fit, &source, lit);
    }
    mem_free(lit);
}

/* Adds to the points' deviations what a highlight may add to albedo, which makes dark surfaces less alike. How dark a
 * segment is is judged once, by the sources' priors: were it judged by the fit, light that makes all dark would explain
 * anything. */
static void allow_for_highlights(struct light_model *m) {
    struct joint_point *p = m->joint;
    float *albedo = mem_array(m->points.count + 1, sizeof *albedo);
    double *x = mem_array(m->fit.source_count, sizeof *x);
    for (size_t j = 0; j < m->fit.source_count; j++)
        x[j] = exp(m->fit.source[j].value);
    for (size_t first = 0, end; first < m->points.count; first = end) {
        for (end = first; end < m->points.count && p[end].segment == p[first].segment; end++)
            albedo[end - first] = p[end].observed / (float)joint_fit_light(&m->fit, end, x);
        float highlight = HIGHLIGHT_ALBEDO / quantile(albedo, end - first, 0.5);
        for (size_t i = first; i < end; i++)
            p[i].deviation = hypotf(p[i].deviation, highlight);
    }
    mem_free(x);
    mem_free(albedo);
}

static void make_fit(struct light_model *m) {
    bool any_escapes = false;
    m->joint = mem_array(m->points.count + 1, sizeof *m->joint);
    for (size_t i = 0; i < m->points.count; i++) {
        const struct light_point *p = &m->points.point[i];
        m->joint[i] =
            (struct joint_point){p->segment, p->patch, rgb_mean(p->observed), rgb_mean(p->known), p->deviation};
        any_escapes = any_escapes || p->escaping > 0.0f;
    }
    joint_fit_init(&m->fit, m->joint, m->points.count, 1 + LIGHT_LAMPS_MOST + UNSEEN_CELLS + LIGHT_REGIONS, m->r->pool);
    for (size_t i = 0; i < m->lamp_count; i++) {
        struct joint_source source = prior_of(m, &m->lamp[i]);
        light_lamp(m, &m->lamp[i]);
        m->lamp[i].source = m->fit.source_count;
        joint_fit_add(&m->fit, &source, m->lamp[i].lit);
    }
    m->fit.tie = m->tie;
    tie_ground(m);
    if (any_escapes)
        add_cells(m);
    add_guesses(m);
    allow_for_highlights(m);
}

void light_model_survey(struct light_model *m, const struct views *views, const struct light_field *field,
                        const struct fused *observed) {
    struct reconstruction *r = m->r;
    struct survey survey;
    struct image known;
    bool has_sky = light_sky_known(&m->sky, &known);
    if (has_sky)
        world_set_environment(&r->world, &known, r->pool);
    survey_lights_on(r, views, m->is_lamp);
    survey_init(&survey, r, field, m->is_lamp, LIGHT_POINTS);
    light_points_init(&m->points, &survey, &m->sky, observed, m->median_radiance);
    survey_release(&survey);
    survey_lights_off(r);
    if (has_sky) {
        world_set_environment(&r->world, &r->environment.map, r->pool);
        image_release(&known);
    }
    make_fit(m);
}

void light_model_add_hidden(struct light_model *m, uint32_t segment, const struct joint_source *source, float *lit) {
    assert(m->lamp_count < LIGHT_LAMPS_MOST);
    m->lamp[m->lamp_count] =
        (struct light_lamp){ESTIMATED_HIDDEN, 1, {segment}, .source = m->fit.source_count, .lit = lit};
    m->lamp_count++;
    m->is_lamp[segment] = true;
    joint_fit_add(&m->fit, source, lit);
}

void light_model_remove_hidden(struct light_model *m, size_t index) {
    struct light_lamp *lamp = &m->lamp[index];
    size_t source = lamp->source;
    assert(lamp->kind == ESTIMATED_HIDDEN);
    m->is_lamp[lamp->segment[0]] = false;
    joint_fit_remove(&m->fit, source);
    mem_free(lamp->lit);
    *lamp = m->lamp[--m->lamp_count];
    for (size_t i = 0; i < m->lamp_count; i++) {
        if (m->lamp[i].source == m->fit.source_count)
            m->lamp[i].source = source;
    }
}

/* --- colours ----------------------------------------------------------------------------------------------- */

/* Fits a channel of the lamps, whose means are known; the unseen sky is grey. */
static void fit_channel(struct light_model *m, int channel) {
    struct joint_point *joint = mem_array(m->points.count + 1, sizeof *joint);
    struct joint_fit fit;
    for (size_t i = 0; i < m->points.count; i++) {
        const struct light_point *p = &m->points.point[i];
        float known = (&p->known.r)[channel];
        for (size_t k = 0; k < UNSEEN_CELLS && m->has_sky && p->sky; k++)
            known += p->sky[k] * (float)exp(m->fit.source[m->first_cell + k].value);
        for (size_t k = 0; k < LIGHT_REGIONS && p->guessed; k++)
            known += p->guessed[3 * k + (size_t)channel] * (float)exp(m->fit.source[m->first_guess + k].value);
        joint[i] = (struct joint_point){p->segment, p->patch, (&p->observed.r)[channel], known, m->joint[i].deviation};
    }
    joint_fit_init(&fit, joint, m->points.count, 1 + m->lamp_count, m->r->pool);
    for (size_t i = 0; i < m->lamp_count; i++) {
        const struct light_lamp *lamp = &m->lamp[i];
        double least = log(fmax((double)(&lamp->least.r)[channel], 1e-30)), mean = m->fit.source[lamp->source].value;
        struct joint_source source = {.mean = mean, .deviation = COLOR_DEVIATION, .least = least, .value = mean};
        if (lamp->kind == ESTIMATED_HIDDEN) {
            source.least = -INFINITY;
        } else if (lamp->kind == ESTIMATED_SEEN) {
            double off = m->fit.source[lamp->source].value - m->fit.source[lamp->source].mean;
            source = (struct joint_source){least + off, MEASURED_DEVIATION, -INFINITY, least + off, 0.0};
        } else if (lamp->is_measured[channel]) {
            source.mean = least, source.value = least, source.deviation = MEASURED_DEVIATION;
        }
        source.value = fmax(source.value, source.least);
        joint_fit_add(&fit, &source, lamp->lit);
    }
    joint_fit_solve(&fit, COLOR_STEPS);
    for (size_t i = 0; i < m->lamp_count; i++)
        (&m->lamp[i].radiance.r)[channel] = (float)exp(fit.source[1 + i].value);
    joint_fit_release(&fit);
    mem_free(joint);
}

void light_model_measure(struct light_model *m) {
    vec3 *position = mem_array(m->points.count + 1, sizeof *position);
    for (size_t i = 0; i < m->points.count; i++)
        position[i] = m->points.point[i].at.position;
    m->patches_alike = joint_alike(&m->fit, position, ALIKE_EDGES * m->points.edge_m);
    mem_free(position);
}

void light_model_finish(struct light_model *m) {
    light_model_measure(m);
    joint_fit_errors(&m->fit);
    for (size_t i = 0; i < m->lamp_count; i++) {
        double error = sqrt(m->patches_alike) * m->fit.source[m->lamp[i].source].error;
        m->lamp[i].deviation = (float)sqrt(error * error + SYSTEMATIC_DEVIATION * SYSTEMATIC_DEVIATION);
    }
    for (int c = 0; c < 3 && m->lamp_count > 0; c++)
        fit_channel(m, c);
}
