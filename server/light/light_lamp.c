/* light_lamp.c -- see light_lamp.h. */
#include "server/light/light_lamp.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

#include "common/mem.h"
#include "server/light/emitters.h"
#include "server/light/light_priors.h"
#include "server/state/evidence.h"

/* Greatest relative difference of area of segments that look alike; of observed radiance it is SEEN_DEVIATION. */
#define ALIKE_AREA 0.02f

void light_lamps_init(struct light_lamps *l, const struct reconstruction *r, float median_radiance) {
    *l = (struct light_lamps){.r = r, .median_radiance = median_radiance};
    l->is_lamp = mem_calloc(r->segments.count + 1, sizeof *l->is_lamp);
    segment_light_init(&l->light, r);
}

void light_lamps_release(struct light_lamps *l) {
    for (size_t i = 0; i < l->count; i++)
        mem_free(l->lamp[i].column);
    segment_light_release(&l->light);
    mem_free(l->is_lamp);
    *l = (struct light_lamps){0};
}

/* --- which segments --------------------------------------------------------------------------------------- */

static bool is_near(float a, float b, float share) { return fabsf(a - b) <= share * fmaxf(a, b); }

/* Whether a segment has the size, the observed radiance and the saturated channels of a lamp. */
static bool is_alike(const struct light_lamps *l, const struct light_lamp *lamp, uint32_t segment) {
    const struct emitter_evidence *e = &l->r->evidence[segment];
    if (lamp->kind != ESTIMATED_SATURATED || lamp->segment_count == LIGHT_MAX ||
        !is_near(l->light.area_m2[lamp->segment[0]], l->light.area_m2[segment], ALIKE_AREA))
        return false;
    for (int c = 0; c < 3; c++) {
        if (lamp->is_measured[c] == e->saturated[c] ||
            !is_near((&lamp->least.r)[c], (&e->observed.r)[c], (float)SEEN_DEVIATION))
            return false;
    }
    return true;
}

static void add_saturated(struct light_lamps *l, uint32_t segment) {
    const struct emitter_evidence *e = &l->r->evidence[segment];
    l->is_lamp[segment] = true;
    for (size_t i = 0; i < l->count; i++) {
        if (is_alike(l, &l->lamp[i], segment)) {
            l->lamp[i].segment[l->lamp[i].segment_count++] = segment;
            return;
        }
    }
    struct light_lamp *lamp = &l->lamp[l->count++];
    *lamp = (struct light_lamp){ESTIMATED_SATURATED, 1, {segment}, .least = e->observed, .radiance = e->radiance};
    for (int c = 0; c < 3; c++)
        lamp->is_measured[c] = !e->saturated[c];
}

static const enum estimated_kind kind_of_half[ENVIRONMENT_HALVES] = {ESTIMATED_SATURATED_SKY,
                                                                     ESTIMATED_SATURATED_GROUND};

void light_lamps_add_half(struct light_lamps *l, size_t half) {
    rgb by = l->r->environment.brightened[half];
    l->lamp[l->count++] = (struct light_lamp){kind_of_half[half], .radiance = rgb_gray(1.0f),
                                              .least = rgb_make(1.0f / by.r, 1.0f / by.g, 1.0f / by.b)};
}

static const struct light_lamp *first_of_kind(const struct light_lamps *l, enum estimated_kind kind) {
    for (size_t i = 0; i < l->count; i++) {
        if (l->lamp[i].kind == kind)
            return &l->lamp[i];
    }
    return NULL;
}

const struct light_lamp *light_lamps_half(const struct light_lamps *l, size_t half) {
    return first_of_kind(l, kind_of_half[half]);
}

void light_lamps_add_sun(struct light_lamps *l, rgb least, rgb strength) {
    l->lamp[l->count++] = (struct light_lamp){ESTIMATED_SUN, .least = least, .radiance = strength};
}

const struct light_lamp *light_lamps_sun(const struct light_lamps *l) { return first_of_kind(l, ESTIMATED_SUN); }

struct light_lamp *light_lamps_add_hidden(struct light_lamps *l, uint32_t segment) {
    assert(l->count < LIGHT_LAMPS_MAX);
    struct light_lamp *lamp = &l->lamp[l->count++];
    l->is_lamp[segment] = true;
    *lamp = (struct light_lamp){.kind = ESTIMATED_HIDDEN, .segment_count = 1, .segment = {segment}};
    return lamp;
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

/* What is as white as all around it may be that; not where people say that it shines. */
static bool is_saturated(const struct reconstruction *r, uint32_t segment) {
    const struct emitter_evidence *e = &r->evidence[segment];
    bool is_known = e->is_seen || (e->is_outshone && settings_emitter(r->settings, segment, false));
    return is_known && evidence_saturates(e);
}

/* Segments, of those that are saturated or are not, that outshine the room, most power first; *found is the
 * caller's. */
static size_t sort_bright(const struct light_lamps *l, bool saturated, struct bright **found) {
    const struct reconstruction *r = l->r;
    size_t count = 0;
    *found = mem_array(r->segments.count + 1, sizeof **found);
    for (size_t i = 0; i < r->segments.count; i++) {
        const struct emitter_evidence *e = &r->evidence[i];
        bool is_bright = saturated || (e->is_seen && emitters_outshine(rgb_mean(e->radiance), l->median_radiance));
        bool may_shine = settings_emitter(r->settings, (uint32_t)i, !e->is_sunlit && !e->is_lit);
        if (is_saturated(r, (uint32_t)i) == saturated && is_bright && !l->is_lamp[i] && may_shine)
            (*found)[count++] = (struct bright){(uint32_t)i, (double)(rgb_mean(e->radiance) * l->light.area_m2[i])};
    }
    qsort(*found, count, sizeof **found, by_power);
    return count;
}

static void choose_saturated(struct light_lamps *l) {
    struct bright *found;
    size_t count = sort_bright(l, true, &found), i;
    for (i = 0; i < count && l->count <= LIGHT_MAX + l->r->openings.count; i++)
        add_saturated(l, found[i].segment);
    l->left_some_out = i < count;
    mem_free(found);
}

/* Lamps that photographs measure: known, but for the error of that. */
static void choose_seen(struct light_lamps *l) {
    struct bright *found;
    size_t count = sort_bright(l, false, &found);
    for (size_t i = 0; i < count && i < LIGHT_SEEN_MAX && l->count < LIGHT_LAMPS_MAX - LIGHT_MAX; i++) {
        const struct emitter_evidence *e = &l->r->evidence[found[i].segment];
        l->is_lamp[found[i].segment] = true;
        l->lamp[l->count++] = (struct light_lamp){ESTIMATED_SEEN,          1,
                                                  {found[i].segment},      .least = e->observed,
                                                  .radiance = e->observed, .is_measured = {true, true, true}};
    }
    mem_free(found);
}

/* Adds the openings, of the radiances that were estimated so far. */
static void choose_openings(struct light_lamps *l) {
    const struct estimated_light *light = &l->r->light;
    for (uint32_t i = 0; i < light->source_count; i++) {
        const struct estimated_source *s = &light->source[i];
        if (s->kind != ESTIMATED_OPENING)
            continue;
        l->is_lamp[s->segment] = true;
        l->lamp[l->count++] =
            (struct light_lamp){ESTIMATED_OPENING, 1, {s->segment}, .radiance = s->radiance, .deviation = s->deviation};
    }
}

static void choose_again(struct light_lamps *l) {
    const struct reconstruction *r = l->r;
    for (size_t i = 0; i < r->segments.count && l->count < LIGHT_LAMPS_MAX; i++) {
        if (segment_range_has(&r->openings, i))
            continue;
        if (r->evidence[i].is_unbounded)
            add_saturated(l, (uint32_t)i);
        else if (r->evidence[i].is_hidden)
            light_lamps_add_hidden(l, (uint32_t)i)->radiance = r->evidence[i].radiance;
    }
}

void light_lamps_choose(struct light_lamps *l, bool again) {
    choose_openings(l);
    if (again)
        choose_again(l);
    else
        choose_saturated(l);
    choose_seen(l);
}

bool light_lamps_has_unknown(const struct light_lamps *l) {
    bool any = false;
    for (size_t i = 0; i < l->count; i++)
        any = any || l->lamp[i].kind != ESTIMATED_SEEN;
    return any;
}

/* --- priors and response ----------------------------------------------------------------------------------- */

struct joint_source light_lamps_hidden_prior(const struct light_lamps *l) {
    double mean = log(LAMP_OVER_ROOM * fmax((double)l->median_radiance, 1e-20));
    return (struct joint_source){.mean = mean, .deviation = LAMP_DEVIATION, .least = -INFINITY, .value = mean};
}

struct joint_source light_lamps_opening_prior(const struct light_lamps *l) {
    double mean = log(OPENING_OVER_ROOM * fmax((double)l->median_radiance, 1e-20));
    return (struct joint_source){.mean = mean, .deviation = LIGHT_UNKNOWN_DEVIATION, .least = -INFINITY, .value = mean};
}

struct joint_source light_lamps_prior(const struct light_lamps *l, const struct light_lamp *lamp) {
    struct joint_source source = light_lamps_hidden_prior(l);
    double least = fmax((double)rgb_mean(lamp->least), 1e-30);
    if (lamp->kind == ESTIMATED_OPENING)
        source = light_lamps_opening_prior(l);
    else if (lamp->kind != ESTIMATED_HIDDEN)
        source = (struct joint_source){.mean = log(least), .deviation = LIGHT_UNKNOWN_DEVIATION, .least = log(least)};
    if (lamp->kind == ESTIMATED_SEEN) {
        source.deviation = SEEN_DEVIATION;
        source.least = -INFINITY;
    }
    if (lamp->kind == ESTIMATED_SUN)
        source.mean = fmax(source.mean, light_lamps_hidden_prior(l).mean);
    source.value = fmax(log(fmax((double)rgb_mean(lamp->radiance), 1e-30)), source.least);
    return source;
}

void light_lamps_respond(const struct light_lamps *l, struct light_lamp *lamp, const struct light_points *points) {
    lamp->column = mem_calloc(points->count + 1, sizeof *lamp->column);
    for (size_t k = 0; k < lamp->segment_count; k++)
        segment_light_add(&l->light, points->point, points->count, lamp->segment[k], SEGMENT_LIGHT_POINTS,
                          lamp->column);
    for (size_t half = 0; half < ENVIRONMENT_HALVES; half++) {
        for (size_t i = 0; i < points->count && lamp->kind == kind_of_half[half]; i++)
            lamp->column[i] = points->point[i].saturated[half];
    }
}
