/* light_estimate.c -- see light_estimate.h. */
#include "server/light/light_estimate.h"

#include <math.h>

#include "common/mem.h"
#include "server/light/emitters.h"
#include "server/light/hidden_lamps.h"
#include "server/light/light_finish.h"
#include "server/light/light_solve.h"
#include "server/light/sun/sun_clipped.h"
#include "server/render/bsdf.h"
#include "server/state/evidence.h"

/* --- handing over ------------------------------------------------------------------------------------------ */

static void keep_source(struct reconstruction *r, enum estimated_kind kind, uint32_t segment, rgb radiance,
                        float deviation) {
    struct estimated_light *light = &r->light;
    if (light->source_count < ESTIMATED_MAX)
        light->source[light->source_count++] = (struct estimated_source){(uint32_t)kind, segment, radiance, deviation};
}

static void hand_over_segment(struct reconstruction *r, const struct light_lamp *lamp, uint32_t segment) {
    struct emitter_evidence *e = &r->evidence[segment];
    rgb radiance = lamp->radiance;
    e->is_unbounded = lamp->kind == ESTIMATED_SATURATED;
    e->is_hidden = !e->is_unbounded;
    e->deviation = lamp->deviation;
    for (int c = 0; c < 3; c++)
        (&radiance.r)[c] = lamp->is_measured[c] ? (&e->observed.r)[c] : (&radiance.r)[c];
    evidence_set_radiance(e, radiance);
    /* Of openings that others make superfluous no more is known than before: they are no sources any more. */
    if (lamp->kind != ESTIMATED_OPENING || (double)lamp->deviation < LIGHT_UNKNOWN_DEVIATION)
        keep_source(r, lamp->kind, segment, radiance, lamp->deviation);
}

static void hand_over_sun(struct reconstruction *r, const struct light_lamp *sun) {
    r->sun.irradiance = rgb_scale(sun->radiance, BSDF_PI);
    keep_source(r, ESTIMATED_SUN, 0, sun->radiance, sun->deviation);
}

/* Takes the factors of sky and ground over, and what they come to. */
static void hand_over_sky(struct light_model *m) {
    struct reconstruction *r = m->r;
    rgb factor[ENVIRONMENT_HALVES] = {rgb_gray(1.0f), rgb_gray(1.0f)};
    for (size_t half = 0; half < ENVIRONMENT_HALVES; half++) {
        const struct light_lamp *lamp = light_lamps_half(&m->lamps, half);
        if (!lamp)
            continue;
        factor[half] = lamp->radiance;
        keep_source(r, lamp->kind, 0, rgb_scale(factor[half], (float)m->sky.bound_radiance[half]), lamp->deviation);
    }
    light_sky_brighten(r, factor);
    if (r->light.factor_count < ESTIMATED_FACTORS) {
        r->light.sky_factor[r->light.factor_count] = factor[0];
        r->light.ground_factor[r->light.factor_count++] = factor[1];
    }
}

static void hand_over(struct light_model *m) {
    struct reconstruction *r = m->r;
    r->light.source_count = 0;
    for (size_t i = 0; i < m->lamps.count; i++) {
        const struct light_lamp *lamp = &m->lamps.lamp[i];
        for (size_t k = 0; k < lamp->segment_count && lamp->kind != ESTIMATED_SEEN; k++)
            hand_over_segment(r, lamp, lamp->segment[k]);
    }
    if (m->sky.estimates_bounds)
        hand_over_sky(m);
    const struct light_lamp *sun = light_lamps_sun(&m->lamps);
    if (sun)
        hand_over_sun(r, sun);
}

/* --- the whole --------------------------------------------------------------------------------------------- */

/* Marks the saturated segments that are no lamps; whether there are any. */
static bool mark_lit(struct light_model *m) {
    bool any = false;
    for (size_t i = 0; i < m->lamps.count; i++) {
        const struct light_lamp *lamp = &m->lamps.lamp[i];
        for (size_t k = 0; k < lamp->segment_count; k++) {
            struct emitter_evidence *e = &m->r->evidence[lamp->segment[k]];
            e->is_lit = lamp->kind == ESTIMATED_SEEN && evidence_saturates(e);
            any = any || e->is_lit;
        }
    }
    return any;
}

/* Where more segments saturate than can be tried at once, those that turn out to reflect make room for others: white
 * walls are larger than lamps. */
static void solve_all(struct light_model *m, const struct views *views) {
    light_model_survey(m, views, NULL, NULL);
    light_solve_deciding(m);
    while (m->lamps.left_some_out && mark_lit(m)) {
        struct reconstruction *r = m->r;
        light_model_release(m);
        light_model_init(m, r, views, false);
        light_model_survey(m, views, NULL, NULL);
        light_solve_deciding(m);
    }
}

static void estimate(struct light_model *m, const struct views *views) {
    solve_all(m, views);
    hidden_lamps_find(m);
    light_solve(m);
    light_finish(m);
    hand_over(m);
}

void light_estimate(struct reconstruction *r, const struct views *views) {
    struct light_model m;
    emitters_observe(r, views, r->evidence);
    if (!r->sun.is_there)
        sun_clipped_find(r);
    light_model_init(&m, r, views, false);
    if (light_lamps_has_unknown(&m.lamps) || hidden_lamps_any(&m))
        estimate(&m, views);
    light_model_release(&m);
    r->light.factor_count = 0; /* on resume the environment is as it is here */
}

void light_estimate_again(struct reconstruction *r, const struct views *views, const struct light_field *field,
                          const struct fused *diffuse) {
    struct light_model m;
    if (!light_is_estimated(r))
        return;
    light_model_init(&m, r, views, true);
    light_model_survey(&m, views, field, diffuse);
    light_solve(&m);
    light_finish(&m);
    hand_over(&m);
    light_model_release(&m);
}

bool light_is_estimated(const struct reconstruction *r) { return r->light.source_count > 0; }

void light_restore(struct reconstruction *r) {
    const struct estimated_light *light = &r->light;
    if (rgb_mean(r->sky_factor) != 1.0f)
        light_sky_brighten(r, (const rgb[]){r->sky_factor, r->sky_factor});
    for (uint32_t i = 0; i < light->factor_count; i++) {
        bool has_ground = !rgb_is_black(light->ground_factor[i]);
        light_sky_brighten(
            r, (const rgb[]){light->sky_factor[i], (has_ground ? light->ground_factor : light->sky_factor)[i]});
    }
}

/* --- report ------------------------------------------------------------------------------------------------ */

/* Middle and area of the triangles of a segment. */
static void report_place(const struct reconstruction *r, cJSON *entry, uint32_t segment) {
    const struct mesh *mesh = &r->scene->mesh;
    double middle[3] = {0.0}, area = 0.0;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        if (r->segments.of_triangle[t] != segment)
            continue;
        vec3 at = mesh_point(mesh, t, 1.0f / 3.0f, 1.0f / 3.0f);
        double own = (double)mesh_triangle_area(mesh, t);
        area += own;
        middle[0] += own * (double)at.x, middle[1] += own * (double)at.y, middle[2] += own * (double)at.z;
    }
    for (int k = 0; k < 3; k++)
        middle[k] = middle[k] / area + mesh->offset[k];
    json_add(entry, "place", cJSON_CreateDoubleArray(middle, 3));
    json_add_number(entry, "m2", area);
}

void light_report(const struct reconstruction *r) {
    static const char *const names[] = {"hidden",  "saturated", "saturated_sky", "seen", "saturated_ground",
                                        "opening", "sun"};
    cJSON *list = cJSON_AddArrayToObject(r->report, "lights");
    for (uint32_t i = 0; i < r->light.source_count; i++) {
        const struct estimated_source *s = &r->light.source[i];
        bool is_segment = s->kind == ESTIMATED_HIDDEN || s->kind == ESTIMATED_SATURATED || s->kind == ESTIMATED_OPENING;
        if (is_segment && !r->is_emitter[s->segment])
            continue;
        cJSON *entry = cJSON_CreateObject();
        json_add_string(entry, "kind", names[s->kind]);
        if (is_segment) {
            json_add_int(entry, "segment", (int64_t)s->segment);
            json_add_int(entry, "object_id", r->segments.id[s->segment]);
            const char *name = segments_name(&r->segments, &r->scene->mesh, s->segment);
            if (name)
                json_add_string(entry, "name", name);
            bool is_added = s->kind == ESTIMATED_OPENING || segment_range_has(&r->unseen_lamps, s->segment);
            json_add_bool(entry, "added", is_added);
            if (is_added)
                report_place(r, entry, s->segment);
        }
        const double radiance[3] = {(double)s->radiance.r, (double)s->radiance.g, (double)s->radiance.b};
        json_add(entry, "radiance", cJSON_CreateDoubleArray(radiance, 3));
        json_add_number(entry, "deviation", (double)s->deviation);
        cJSON_AddItemToArray(list, entry);
    }
}
