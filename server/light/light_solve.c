/* light_solve.c -- see light_solve.h. */
#include "server/light/light_solve.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "common/quantile.h"

/* Rounds of the light by the albedos of what the sun lights, and of these by the light. */
#define SUN_ROUNDS 3

/* --- the sun ------------------------------------------------------------------------------------------------ */

/* Albedos by the fit, of parts of which nothing is measured that of another part of the object. [segment_count]; the
 * caller's. */
static float *find_albedos(const struct light_model *m) {
    const struct segments *s = &m->r->segments;
    float *known = mem_calloc(s->count + 1, sizeof *known), *albedo = mem_array(s->count + 1, sizeof *albedo);
    bool *is_known = mem_array(s->count + 1, sizeof *is_known);
    light_model_find_albedos(m, known);
    for (size_t i = 0; i < s->count; i++)
        is_known[i] = known[i] > 0.0f;
    for (uint32_t i = 0; i < s->count; i++) {
        uint32_t like = segments_known_part(s, i, is_known);
        albedo[i] = is_known[like] ? fminf(known[like], (float)ALBEDO_WHITE) : NEUTRAL_BASE_COLOR;
    }
    mem_free(is_known);
    mem_free(known);
    return albedo;
}

/* What sunlit surfaces send depends on their albedos, which are lower the more light there is. */
static void renew_sun(struct light_model *m, const struct light_lamp *sun) {
    float *albedo = find_albedos(m);
    memset(sun->column, 0, m->points.count * sizeof *sun->column);
    sunlit_respond(&m->sunlit, &m->lamps.light, m->points.point, m->points.count, albedo, sun->column);
    for (size_t i = 0; i < m->points.count; i++)
        m->fit.response[i * m->fit.source_max + sun->source] = sun->column[i];
    mem_free(albedo);
}

/* --- lamps that may as well reflect ------------------------------------------------------------------------- */

/* The median of what a lamp's points show at least over what they get of all other light; false: it has no points. */
static bool find_ratio(const struct light_model *m, const struct light_lamp *lamp, const double *x, float *ratio) {
    float *value = mem_array(m->points.count + 1, sizeof *value);
    size_t count = 0;
    for (size_t i = 0; i < m->points.count; i++) {
        bool is_own = false;
        for (size_t k = 0; k < lamp->segment_count; k++)
            is_own = is_own || m->joint[i].segment == lamp->segment[k];
        double light = is_own ? joint_fit_light(&m->fit, i, x) - (double)lamp->column[i] * x[lamp->source] : 0.0;
        if (is_own)
            value[count++] = m->joint[i].observed / (float)fmax(light, 1e-30);
    }
    if (count > 0)
        *ratio = quantile(value, count, 0.5);
    mem_free(value);
    return count > 0;
}

/* What reflects light that makes white paint saturate: its albedo lies between that which just saturates and white. */
static void let_reflect(struct light_model *m, struct light_lamp *lamp, float ratio) {
    struct joint_source *source = &m->fit.source[lamp->source];
    double range = fmax(log(ALBEDO_WHITE / (double)ratio), 0.0);
    lamp->kind = ESTIMATED_SEEN;
    lamp->least = rgb_scale(lamp->least, (float)exp(0.5 * range));
    *source = (struct joint_source){.mean = log(fmax((double)rgb_mean(lamp->least), 1e-30)), .least = -INFINITY};
    source->deviation = fmax(0.5 * range, SEEN_DEVIATION);
    source->value = source->mean;
}

/* Whether people say that it shines. */
static bool is_told(const struct light_model *m, const struct light_lamp *lamp) {
    bool any = false;
    for (size_t k = 0; k < lamp->segment_count; k++)
        any = any || settings_emitter(m->r->settings, lamp->segment[k], false);
    return any;
}

static size_t drop_reflecting(struct light_model *m) {
    double *x = joint_fit_radiances(&m->fit);
    size_t dropped = 0;
    for (size_t i = 0; i < m->lamps.count; i++) {
        struct light_lamp *lamp = &m->lamps.lamp[i];
        float ratio;
        if (lamp->kind != ESTIMATED_SATURATED || is_told(m, lamp) || !find_ratio(m, lamp, x, &ratio) ||
            ratio > (float)ALBEDO_WHITE)
            continue;
        let_reflect(m, lamp, ratio);
        dropped++;
    }
    mem_free(x);
    return dropped;
}

/* --- the whole ---------------------------------------------------------------------------------------------- */

void light_solve(struct light_model *m) {
    const struct light_lamp *sun = light_lamps_sun(&m->lamps);
    joint_fit_solve(&m->fit);
    for (int i = 0; i < SUN_ROUNDS && sun; i++) {
        renew_sun(m, sun);
        joint_fit_solve(&m->fit);
    }
}

void light_solve_deciding(struct light_model *m) {
    light_solve(m);
    while (drop_reflecting(m) > 0)
        light_solve(m);
}
