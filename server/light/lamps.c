/* lamps.c -- see lamps.h. */
#include "server/light/lamps.h"

#include <assert.h>
#include <math.h>

#include "common/mem.h"
#include "common/spaced.h"
#include "server/gather/incident.h"
#include "server/render/sampler.h"
#include "server/state/evidence.h"

#define ROUNDS 2 /* in which each lamp's radiance is fitted again, the others being known */
/* A room is open if at least this part of the rays from its surfaces leaves in unobserved directions. */
#define OPEN 0.02
#define OPEN_PLACES 2048
#define OPEN_RAYS 16 /* a place */
#define KEY_OPEN 31
#define SKY_RAYS 128 /* a place */
#define KEY_SKY 37   /* keeps these random numbers apart from others of the place */
/* Greatest relative differences, of area and of observed radiance, of similar segments. */
#define ALIKE_AREA 0.02f
#define ALIKE_RADIANCE 0.1f
/* Least part of a place's light that is left when the sky's is subtracted. */
#define LEFT 0.01f

/* --- what a lamp lights ------------------------------------------------------------------------------------ */

/* Lambert radiance by the saturated and filled-in directions of the map. */
static void light_by_sky(void *user, size_t index, int thread) {
    (void)thread;
    const struct lamps *l = user;
    const struct reconstruction *r = l->r;
    struct light_place *p = &l->places.place[index];
    vec3 frame[3] = {[2] = p->at.shading};
    vec3_frame(p->at.shading, &frame[0], &frame[1]);
    uint32_t key = sampler_key(KEY_SKY, (uint32_t)index, 0);
    p->lit = 0.0f;
    for (uint32_t k = 0; k < SKY_RAYS; k++) {
        vec3 d = incident_cosine_direction(frame, sampler_pair(key, k, 0));
        vec3 from = accel_offset(p->at.position, p->at.normal, d);
        if (!environment_is_measured(&r->environment, d) && !accel_occluded(r->world.accel, from, d, 0.0f, INFINITY))
            p->lit += rgb_mean(lights_environment(r->world.lights, d)) / SKY_RAYS;
    }
}

void lamps_shine(struct light_places *places, rgb radiance) {
    for (size_t i = 0; i < places->count; i++) {
        struct light_place *p = &places->place[i];
        p->white = rgb_mad(p->white, p->lit, radiance);
    }
}

/* Subtracts the light of the sky that the survey already contains. */
static void darken(struct light_places *places) {
    for (size_t i = 0; i < places->count; i++) {
        struct light_place *p = &places->place[i];
        for (int c = 0; c < 3; c++) {
            float *white = &(&p->white.r)[c];
            *white = fmaxf(*white - p->lit, LEFT * *white);
        }
    }
}

static void take_lit(struct lamps *l, const struct lamp *lamp) {
    for (size_t i = 0; i < l->places.count; i++)
        l->places.place[i].lit = lamp->lit[i];
}

static void light_lamp(struct lamps *l, struct lamp *lamp) {
    lamp->lit = mem_calloc(l->places.count + 1, sizeof *lamp->lit);
    for (size_t k = 0; k < lamp->segment_count; k++) {
        if (lamps_is_sky(lamp)) {
            parallel_for(l->r->pool, l->places.count, light_by_sky, l);
            darken(&l->places);
        } else {
            segment_light_places(&l->light, &l->places, lamp->segment[k], SEGMENT_LIGHT_POINTS);
        }
        for (size_t i = 0; i < l->places.count; i++)
            lamp->lit[i] += l->places.place[i].lit;
    }
    take_lit(l, lamp);
    lamps_shine(&l->places, lamp->radiance);
}

struct lamp *lamps_add(struct lamps *l, uint32_t segment, rgb radiance) {
    assert(l->count < LAMPS_MOST);
    struct lamp *lamp = &l->lamp[l->count++];
    *lamp = (struct lamp){.segment_count = 1, .segment = {segment}, .radiance = radiance};
    if (segment != LAMPS_SKY)
        l->without[segment] = true;
    if (l->places.place)
        light_lamp(l, lamp);
    return lamp;
}

static bool is_near(float a, float b, float share) { return fabsf(a - b) <= share * fmaxf(a, b); }

/* Whether two lamps have the same size and observed radiance, and the same saturated channels. */
static bool is_alike(const struct lamps *l, const struct lamp *lamp, uint32_t segment) {
    const struct emitter_evidence *e = &l->r->evidence[segment];
    if (lamps_is_sky(lamp) || rgb_is_black(lamp->least) || lamp->segment_count == LAMPS_ALIKE_MOST ||
        !is_near(l->light.area_m2[lamp->segment[0]], l->light.area_m2[segment], ALIKE_AREA))
        return false;
    for (int c = 0; c < 3; c++) {
        if (lamp->is_measured[c] == e->saturated[c] ||
            !is_near((&lamp->least.r)[c], (&e->observed.r)[c], ALIKE_RADIANCE))
            return false;
    }
    return true;
}

void lamps_add_bound(struct lamps *l, uint32_t segment) {
    const struct emitter_evidence *e = &l->r->evidence[segment];
    for (size_t i = 0; i < l->count; i++) {
        struct lamp *other = &l->lamp[i];
        if (!is_alike(l, other, segment))
            continue;
        other->segment[other->segment_count++] = segment;
        l->without[segment] = true;
        return;
    }
    struct lamp *lamp = lamps_add(l, segment, e->radiance);
    lamp->least = e->observed;
    for (int c = 0; c < 3; c++)
        lamp->is_measured[c] = !e->saturated[c];
}

void lamps_add_sky(struct lamps *l) {
    rgb by = l->r->environment.brightened;
    struct lamp *lamp = lamps_add(l, LAMPS_SKY, rgb_gray(1.0f));
    lamp->least = rgb_make(1.0f / by.r, 1.0f / by.g, 1.0f / by.b);
}

void lamps_survey(struct lamps *l, const struct views *views, const struct light_field *field,
                  const struct fused *shown) {
    struct survey survey;
    survey_lights_on(l->r, views, l->without);
    survey_init(&survey, l->r, field, l->without, LIGHT_PLACES);
    light_places_init(&l->places, &survey, shown);
    survey_release(&survey);
    survey_lights_off(l->r);
    for (size_t i = 0; i < l->places.count; i++) {
        struct light_place *p = &l->places.place[i];
        p->weight = rgb_mean(p->shown) / (rgb_mean(p->shown) + l->median_radiance);
    }
    for (size_t i = 0; i < l->count; i++)
        light_lamp(l, &l->lamp[i]);
    missing_light_init(&l->missing, &l->places, LAMPS_WHITEST, false);
}

bool lamps_is_open(const struct lamps *l) {
    const struct reconstruction *r = l->r;
    size_t out = 0, wanted = l->places.count < OPEN_PLACES ? l->places.count : OPEN_PLACES;
    for (size_t i = 0; i < wanted; i++) {
        const struct surface_point *at = &l->places.place[spaced(i, l->places.count, wanted)].at;
        vec3 frame[3] = {[2] = at->shading};
        vec3_frame(at->shading, &frame[0], &frame[1]);
        for (uint32_t k = 0; k < OPEN_RAYS; k++) {
            vec3 d = incident_cosine_direction(frame, sampler_pair(sampler_key(KEY_OPEN, (uint32_t)i, 0), k, 0));
            bool is_seen = r->environment.map.pixel && environment_is_seen(&r->environment, d);
            vec3 from = accel_offset(at->position, at->normal, d);
            out += !is_seen && !accel_occluded(r->world.accel, from, d, 0.0f, INFINITY);
        }
    }
    return (double)out > OPEN * OPEN_RAYS * (double)wanted;
}

/* --- how bright they are ----------------------------------------------------------------------------------- */

/* Adds missing radiance to the observed one, in the saturated channels. */
static void set_radiance(struct lamp *lamp, rgb more) {
    lamp->radiance = lamp->least;
    for (int c = 0; c < 3; c++)
        (&lamp->radiance.r)[c] += lamp->is_measured[c] ? 0.0f : (&more.r)[c];
}

void lamps_fit_one(struct lamps *l, struct lamp *lamp) {
    take_lit(l, lamp);
    lamps_shine(&l->places, rgb_sub(lamp->least, lamp->radiance));
    set_radiance(lamp, missing_light_color(&l->missing));
    lamps_shine(&l->places, rgb_sub(lamp->radiance, lamp->least));
}

float lamps_missing(struct lamps *l, const struct lamp *lamp, double *explained) {
    take_lit(l, lamp);
    return missing_light_strength(&l->missing, MISSING_MEAN, explained);
}

void lamps_fit_all(struct lamps *l, size_t count) {
    missing_light_renew(&l->missing);
    for (size_t i = 0; i < ROUNDS * count; i++)
        lamps_fit_one(l, &l->lamp[i % count]);
    missing_light_renew(&l->missing);
}

/* --- the whole --------------------------------------------------------------------------------------------- */

void lamps_init(struct lamps *l, struct reconstruction *r, const struct views *views) {
    *l = (struct lamps){.r = r, .median_radiance = views->median_radiance};
    l->without = mem_calloc(r->segments.count + 1, sizeof *l->without);
    segment_light_init(&l->light, r);
}

void lamps_release(struct lamps *l) {
    for (size_t i = 0; i < l->count; i++)
        mem_free(l->lamp[i].lit);
    missing_light_release(&l->missing);
    light_places_release(&l->places);
    segment_light_release(&l->light);
    mem_free(l->without);
    *l = (struct lamps){0};
}

void lamps_brighten_sky(struct reconstruction *r, rgb factor) {
    environment_brighten(&r->environment, factor);
    world_set_environment(&r->world, &r->environment.map, r->pool);
}

static void hand_over_segment(struct reconstruction *r, const struct lamp *lamp, uint32_t segment) {
    struct emitter_evidence *e = &r->evidence[segment];
    e->is_unbounded = !rgb_is_black(lamp->least);
    e->is_hidden = !e->is_unbounded;
    rgb radiance = lamp->radiance;
    for (int c = 0; c < 3; c++)
        (&radiance.r)[c] = lamp->is_measured[c] ? (&e->observed.r)[c] : (&radiance.r)[c];
    evidence_set_radiance(e, radiance);
}

void lamps_hand_over(const struct lamps *l, size_t count) {
    for (size_t i = 0; i < count; i++) {
        const struct lamp *lamp = &l->lamp[i];
        if (lamps_is_sky(lamp)) {
            lamps_brighten_sky(l->r, lamp->radiance);
            continue;
        }
        for (size_t k = 0; k < lamp->segment_count; k++)
            hand_over_segment(l->r, lamp, lamp->segment[k]);
    }
}

static bool is_brightened(const struct environment *e) { return e->map.pixel && rgb_mean(e->brightened) > 1.0f; }

bool lamps_are_estimated(const struct reconstruction *r) {
    bool any = false;
    for (size_t i = 0; i < r->segments.count; i++)
        any = any || r->evidence[i].is_hidden || r->evidence[i].is_unbounded;
    return any;
}

void lamps_refit(struct reconstruction *r, const struct views *views, const struct light_field *field,
                 const struct fused *shown) {
    struct lamps l;
    lamps_init(&l, r, views);
    if (!shown && is_brightened(&r->environment))
        lamps_add_sky(&l);
    for (size_t i = 0; i < r->segments.count && l.count < LAMPS_MOST; i++) {
        if (r->evidence[i].is_hidden)
            lamps_add(&l, (uint32_t)i, r->evidence[i].radiance);
        else if (r->evidence[i].is_unbounded)
            lamps_add_bound(&l, (uint32_t)i);
    }
    if (l.count > 0) {
        lamps_survey(&l, views, field, shown);
        lamps_fit_all(&l, l.count);
        if (lamps_is_sky(&l.lamp[0]))
            r->sky_factor = l.lamp[0].radiance;
    }
    lamps_hand_over(&l, l.count);
    lamps_release(&l);
}
