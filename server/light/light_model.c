/* light_model.c -- see light_model.h. */
#include "server/light/light_model.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "server/light/bounced_light.h"
#include "server/light/joint_alike.h"
#include "server/light/light_priors.h"
#include "server/render/bsdf.h"

/* Errors of patches agree up to this distance, in edges of patches: about 1 m, as far as a lamp near a surface
 * lights. */
#define ALIKE_EDGES 3.5f
/* Of a point that tells nothing. */
#define UNTOLD_DEVIATION 1e3f

void light_model_init(struct light_model *m, struct reconstruction *r, const struct views *views, bool again) {
    *m = (struct light_model){.r = r, .albedo = mem_array(r->segments.count + 1, sizeof *m->albedo)};
    light_lamps_init(&m->lamps, r, views->median_radiance);
    light_sky_init(&m->sky, &r->environment);
    if (r->environment.map.pixel && r->environment.saturated_share > 0.0 && !r->sky_is_fitted) {
        m->sky.estimates_bounds = true;
        for (size_t half = 0; half < ENVIRONMENT_HALVES; half++) {
            if (m->sky.bound_share[half] > 0.0)
                light_lamps_add_half(&m->lamps, half);
        }
    }
    m->sky.is_dark = r->is_surrounded;
    if (r->sun.is_clipped) {
        sunlit_init(&m->sunlit, r, views);
        sunlit_mark(&m->sunlit);
        rgb least = sunlit_least(&m->sunlit), shown = rgb_scale(r->sun.least, 1.0f / BSDF_PI);
        least = rgb_make(fmaxf(least.r, shown.r), fmaxf(least.g, shown.g), fmaxf(least.b, shown.b));
        light_lamps_add_sun(&m->lamps, least, rgb_scale(r->sun.irradiance, 1.0f / BSDF_PI));
    }
    light_lamps_choose(&m->lamps, again);
}

void light_model_release(struct light_model *m) {
    joint_fit_release(&m->fit);
    mem_free(m->joint);
    mem_free(m->albedo);
    light_points_release(&m->points);
    sunlit_release(&m->sunlit);
    light_sky_release(&m->sky);
    light_lamps_release(&m->lamps);
    *m = (struct light_model){0};
}

static void tie(struct light_model *m, size_t a, size_t b, double difference, double deviation) {
    m->tie[m->fit.tie_count++] = (struct joint_tie){a, b, difference, deviation};
}

/* The half whose seen directions the fill of a half continues: its own, or the other one if none of its own is seen. */
static size_t half_filled_from(const struct light_model *m, size_t half) {
    return m->sky.bound_share[half] < 0.0 ? 1 - half : half;
}

/* The fill continues what is seen: as far as that saturates, the fill is as much brighter as it is. */
static void add_cell(struct light_model *m, size_t k, const float *column) {
    const struct environment *e = &m->r->environment;
    size_t half = half_filled_from(m, sky_cells_half(k));
    const struct light_lamp *bound = light_lamps_half(&m->lamps, half);
    double fill = m->sky.fill[k], part = bound ? m->sky.bound_share[half] : 0.0;
    double mean = log(fmax(fill, 1e-3 * fmax((double)m->lamps.median_radiance, 1e-20)));
    double deviation = FILL_DEVIATION;
    if (!e->map.pixel)
        mean = log(fmax((double)m->lamps.median_radiance, 1e-20)), deviation = LIGHT_UNKNOWN_DEVIATION;
    struct joint_source source = {.mean = mean, .deviation = deviation, .least = -INFINITY, .value = mean};
    if (bound) {
        source.deviation = deviation / sqrt(fmax(1.0 - part, 0.01));
        tie(m, m->first_cell + k, bound->source, mean, deviation / sqrt(part));
    }
    joint_fit_add(&m->fit, &source, column);
}

/* By the radiances of saturated sky and ground. */
static void tie_ground(struct light_model *m) {
    const struct light_lamp *sky = light_lamps_half(&m->lamps, 0), *ground = light_lamps_half(&m->lamps, 1);
    double ratio = GROUND_OVER_SKY * m->sky.bound_radiance[0] / m->sky.bound_radiance[1];
    if (sky && ground)
        tie(m, ground->source, sky->source, log(ratio), FILL_DEVIATION);
}

static void add_cells(struct light_model *m) {
    float *column = mem_calloc(m->points.count + 1, sizeof *column);
    struct joint_source around = light_lamps_opening_prior(&m->lamps);
    around.value = log(fmax((double)m->lamps.median_radiance, 1e-20)); /* not dim, or the first to gain takes all */
    m->first_cell = m->fit.source_count;
    m->has_sky = true;
    for (size_t k = 0; k < light_sky_cells(&m->sky); k++) {
        for (size_t i = 0; i < m->points.count; i++)
            column[i] = m->points.point[i].sky ? m->points.point[i].sky[k] : 0.0f;
        if (m->sky.surround)
            joint_fit_add(&m->fit, &around, column);
        else
            add_cell(m, k, column);
    }
    mem_free(column);
}

static float region_mean(const struct light_point *p, size_t region) {
    const float *radiance = p->unobserved + 3 * region;
    return (radiance[0] + radiance[1] + radiance[2]) / 3.0f;
}

/* What surfaces send that no photograph shows, by region, as a factor of their fill. */
static void add_regions(struct light_model *m) {
    float *column = mem_calloc(m->points.count + 1, sizeof *column);
    const struct joint_source source = {.deviation = FILL_DEVIATION, .least = -INFINITY};
    m->first_region = m->fit.source_count;
    for (size_t k = 0; k < LIGHT_REGIONS; k++) {
        for (size_t i = 0; i < m->points.count; i++)
            column[i] = m->points.point[i].unobserved ? region_mean(&m->points.point[i], k) : 0.0f;
        joint_fit_add(&m->fit, &source, column);
    }
    mem_free(column);
}

void light_model_find_albedos(const struct light_model *m, float *albedo) {
    const struct joint_point *p = m->joint;
    float *sorted = mem_array(m->points.count + 1, sizeof *sorted);
    double *x = joint_fit_radiances(&m->fit);
    for (size_t first = 0, end; first < m->points.count; first = end) {
        size_t measured = 0;
        for (end = first; end < m->points.count && p[end].segment == p[first].segment; end++) {
            if (!p[end].is_bound && !p[end].is_lamp)
                sorted[measured++] = p[end].observed / (float)joint_fit_light(&m->fit, end, x);
        }
        if (measured > 0)
            albedo[p[first].segment] = quantile(sorted, measured, 0.5);
    }
    mem_free(x);
    mem_free(sorted);
}

void light_model_allow_for_highlights(struct light_model *m) {
    light_model_find_albedos(m, m->albedo);
    for (size_t i = 0; i < m->points.count; i++)
        m->joint[i].deviation = hypotf(m->joint[i].deviation, ALBEDO_HIGHLIGHT / m->albedo[m->joint[i].segment]);
    for (size_t i = 0; i < m->points.count; i++)
        m->albedo[m->joint[i].segment] = fminf(m->albedo[m->joint[i].segment], (float)ALBEDO_WHITE);
}

/* Discs of what unseen surfaces reflect of a hidden lamp; the first result is the caller's. */
static struct segment_light_disc *find_bounced(const struct light_model *m, uint32_t segment, size_t *count) {
    struct segment_light_disc *disc = mem_array(BOUNCED_MAX, sizeof *disc);
    *count = bounced_light_find(&m->lamps.light, segment, m->albedo, disc);
    return disc;
}

void light_model_respond_hidden(const struct light_model *m, uint32_t segment, float *column) {
    const struct light_points *p = &m->points;
    size_t count;
    struct segment_light_disc *disc = find_bounced(m, segment, &count);
    segment_light_add(&m->lamps.light, p->point, p->count, segment, SEGMENT_LIGHT_POINTS, column);
    segment_light_add_discs(&m->lamps.light, p->point, p->count, disc, count, column);
    mem_free(disc);
}

/* Puts the discs of a region first; returns their number. */
static size_t put_first(const struct light_points *p, struct segment_light_disc *disc, size_t count, size_t region) {
    size_t first = 0;
    for (size_t i = 0; i < count; i++) {
        if (light_points_region(p, disc[i].at.position) == region) {
            struct segment_light_disc other = disc[first];
            disc[first++] = disc[i], disc[i] = other;
        }
    }
    return first;
}

/* Once unseen surfaces are known to be lit by a hidden lamp, their light has what they reflect of it: it is taken off,
 * as the lamp's column has it. */
static void take_bounced_off(struct light_model *m, const struct light_lamp *lamp) {
    size_t count, points = m->points.count;
    struct segment_light_disc *disc = find_bounced(m, lamp->segment[0], &count);
    float *bounced = mem_array(points + 1, sizeof *bounced);
    for (size_t k = 0; k < LIGHT_REGIONS; k++) {
        size_t of_region = put_first(&m->points, disc, count, k);
        if (of_region == 0)
            continue;
        memset(bounced, 0, points * sizeof *bounced);
        segment_light_add_discs(&m->lamps.light, m->points.point, points, disc, of_region, bounced);
        for (size_t i = 0; i < points; i++) {
            float *unobserved = m->points.point[i].unobserved ? m->points.point[i].unobserved + 3 * k : NULL;
            for (size_t c = 0; c < 3 && unobserved; c++)
                unobserved[c] = fmaxf(unobserved[c] - bounced[i] * (&lamp->radiance.r)[c], 0.0f);
            if (unobserved)
                m->fit.response[i * m->fit.source_max + m->first_region + k] = region_mean(&m->points.point[i], k);
        }
    }
    mem_free(bounced);
    mem_free(disc);
}

/* A lamp's column of the response: of hidden ones and of the sun by albedos. */
static void respond(struct light_model *m, struct light_lamp *lamp) {
    if (lamp->kind != ESTIMATED_HIDDEN && lamp->kind != ESTIMATED_SUN) {
        light_lamps_respond(&m->lamps, lamp, &m->points);
        return;
    }
    lamp->column = mem_calloc(m->points.count + 1, sizeof *lamp->column);
    if (lamp->kind == ESTIMATED_SUN) {
        sunlit_respond(&m->sunlit, &m->lamps.light, m->points.point, m->points.count, m->albedo, lamp->column);
        return;
    }
    light_model_respond_hidden(m, lamp->segment[0], lamp->column);
    take_bounced_off(m, lamp);
}

/* Adds those whose response takes albedos, or the others. */
static void add_lamps(struct light_model *m, bool by_albedo) {
    for (size_t i = 0; i < m->lamps.count; i++) {
        struct light_lamp *lamp = &m->lamps.lamp[i];
        struct joint_source source = light_lamps_prior(&m->lamps, lamp);
        if ((lamp->kind == ESTIMATED_HIDDEN || lamp->kind == ESTIMATED_SUN) != by_albedo)
            continue;
        respond(m, lamp);
        lamp->source = m->fit.source_count;
        joint_fit_add(&m->fit, &source, lamp->column);
    }
}

/* Takes points that cannot tell how strong the sun is out of the fit. */
static void look_at_sun(struct light_model *m) {
    bool *is_told = mem_array(m->points.count + 1, sizeof *is_told);
    sunlit_look(&m->sunlit, m->points.point, m->points.count, is_told);
    for (size_t i = 0; i < m->points.count; i++)
        m->joint[i].deviation = is_told[i] ? m->joint[i].deviation : UNTOLD_DEVIATION;
    mem_free(is_told);
}

static void make_fit(struct light_model *m) {
    bool any_escapes = false;
    for (size_t s = 0; s < m->r->segments.count; s++)
        m->albedo[s] = NEUTRAL_BASE_COLOR;
    m->joint = mem_array(m->points.count + 1, sizeof *m->joint);
    for (size_t i = 0; i < m->points.count; i++) {
        const struct light_point *p = &m->points.point[i];
        m->joint[i] = (struct joint_point){
            p->segment, p->patch, rgb_mean(p->observed), rgb_mean(p->known), p->deviation, p->is_bound, p->is_lamp};
        any_escapes = any_escapes || p->escaping > 0.0f;
    }
    if (m->r->sun.is_clipped)
        look_at_sun(m);
    joint_fit_init(&m->fit, m->joint, m->points.count, 1 + LIGHT_LAMPS_MAX + LIGHT_CELLS + LIGHT_REGIONS, m->r->pool);
    add_lamps(m, false);
    m->fit.tie = m->tie;
    tie_ground(m);
    if (any_escapes)
        add_cells(m);
    add_regions(m);
    light_model_allow_for_highlights(m);
    add_lamps(m, true);
}

void light_model_survey(struct light_model *m, const struct views *views, const struct light_field *field,
                        const struct fused *observed) {
    struct reconstruction *r = m->r;
    struct survey survey;
    struct image known;
    const struct sun sun = r->sun;
    if (sun.is_clipped)
        r->sun.irradiance = rgb_gray(0.0f); /* a source */
    bool has_sky = light_sky_known(&m->sky, &known);
    if (has_sky)
        world_set_environment(&r->world, &known, r->pool);
    survey_init(&survey, r, views, field, m->lamps.is_lamp, true, LIGHT_POINTS);
    sunlit_shade(&m->sunlit, survey.radiance);
    light_points_init(&m->points, &survey, &m->sky, observed, m->lamps.median_radiance);
    survey_release(&survey);
    r->sun = sun;
    if (has_sky) {
        world_set_environment(&r->world, &r->environment.map, r->pool);
        image_release(&known);
    }
    make_fit(m);
}

static double measure_alike(const struct light_model *m, size_t source) {
    vec3 *position = mem_array(m->points.count + 1, sizeof *position);
    for (size_t i = 0; i < m->points.count; i++)
        position[i] = m->points.point[i].at.position;
    double alike = joint_alike(&m->fit, position, ALIKE_EDGES * m->points.edge_m, source);
    mem_free(position);
    return alike;
}

double light_model_alike_last(const struct light_model *m) { return measure_alike(m, m->fit.source_count - 1); }

void light_model_find_errors(struct light_model *m) {
    m->patches_alike = measure_alike(m, JOINT_ALIKE_ALL);
    joint_fit_errors(&m->fit);
    for (size_t j = 0; j < m->fit.source_count; j++)
        m->fit.source[j].error *= sqrt(m->patches_alike);
    m->fit.light_error *= sqrt(m->patches_alike);
}
