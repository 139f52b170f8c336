/* hidden_lamps.c -- see hidden_lamps.h. */
#include "server/light/hidden_lamps.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "server/state/evidence.h"

/* Points of a candidate that represent its area while all are screened; the likeliest get SEGMENT_LIGHT_POINTS. */
#define SCREEN_POINTS 8
/* Candidates that are tried with their whole response. */
#define LIKELIEST 8
/* Candidates that are tried again once there is a further lamp, for time: it takes from what most of them gain. */
#define AGAIN 32

struct lamp_candidate {
    bool is_segment; /* else a part of the border of unseen space */
    uint32_t number; /* of the segment or part */
    double gain;     /* nats */
    bool is_whole;   /* `column` is all of its response, and not of SCREEN_POINTS */
    float *column;   /* of the response; owned */
    struct joint_source source;
};

struct lamp_search {
    struct light_model *m;
    const struct unseen_space *space; /* NULL: only segments are sought */
    size_t count, part_count;
    struct lamp_candidate *candidate; /* [count] once they were tried the likeliest first */
    bool was_tried;
    uint32_t part[LIGHT_MAX]; /* [part_count] that are lamps */
};

/* --- candidates -------------------------------------------------------------------------------------------- */

/* No photograph shows it, and it has a surface. */
static bool may_be_lamp(const struct light_model *m, size_t segment) {
    const struct emitter_evidence *e = &m->r->evidence[segment];
    return !e->is_seen && !e->is_outshone && !m->lamps.is_lamp[segment] && m->lamps.light.area_m2[segment] > 0.0f &&
           settings_emitter(m->r->settings, (uint32_t)segment, true);
}

bool hidden_lamps_any(const struct light_model *m) {
    bool any = false;
    for (size_t i = 0; i < m->r->segments.count; i++)
        any = any || may_be_lamp(m, i);
    return any;
}

/* Points of a part, evenly spread over its faces. */
static size_t spread_part(const struct unseen_space *u, uint32_t number, size_t wanted,
                          struct segment_light_disc *disc) {
    const struct unseen_part *part = &u->part[number];
    size_t faces = part->end - part->first, count = faces < wanted ? faces : wanted;
    float area_m2 = u->side_m * u->side_m * (float)faces / (float)count;
    for (size_t i = 0; i < count; i++) {
        const struct unseen_face *face = &u->face[part->first + (2 * i + 1) * faces / (2 * count)];
        struct surface_point at = {.position = face->middle, .normal = face->normal, .shading = face->normal};
        disc[i] = (struct segment_light_disc){at, area_m2, 1.0f};
    }
    return count;
}

/* Fills a candidate's column, by so many points, or as well as it can be. */
static void respond(const struct lamp_search *s, struct lamp_candidate *c, size_t points) {
    const struct light_model *m = s->m;
    struct segment_light_disc disc[SEGMENT_LIGHT_POINTS];
    c->is_whole = points == SEGMENT_LIGHT_POINTS;
    memset(c->column, 0, m->points.count * sizeof *c->column);
    if (!c->is_segment)
        segment_light_add_discs(&m->lamps.light, m->points.point, m->points.count, disc,
                                spread_part(s->space, c->number, points, disc), c->column);
    else if (c->is_whole)
        light_model_respond_hidden(m, c->number, c->column);
    else
        segment_light_add(&m->lamps.light, m->points.point, m->points.count, c->number, points, c->column);
}

static void add_candidate(struct lamp_search *s, bool is_segment, uint32_t number) {
    struct lamp_candidate *c = &s->candidate[s->count++];
    *c = (struct lamp_candidate){.is_segment = is_segment, .number = number};
    c->column = mem_calloc(s->m->points.count + 1, sizeof *c->column);
    respond(s, c, SCREEN_POINTS);
}

static void find_candidates(struct lamp_search *s) {
    const struct light_model *m = s->m;
    size_t parts = s->space ? s->space->part_count : 0;
    s->candidate = mem_calloc(m->r->segments.count + parts + 1, sizeof *s->candidate);
    for (size_t i = 0; i < m->r->segments.count; i++) {
        if (may_be_lamp(m, i))
            add_candidate(s, true, (uint32_t)i);
    }
    for (size_t i = 0; i < parts; i++)
        add_candidate(s, false, (uint32_t)i);
}

static void try_candidate(void *user, size_t index, int thread) {
    (void)thread;
    const struct lamp_search *s = user;
    struct lamp_candidate *c = &s->candidate[index];
    c->source = light_lamps_hidden_prior(&s->m->lamps);
    c->gain = joint_fit_try(&s->m->fit, &c->source, c->column);
}

static int by_gain(const void *a, const void *b) {
    const struct lamp_candidate *first = a, *second = b;
    if (first->gain != second->gain)
        return first->gain < second->gain ? 1 : -1;
    if (first->is_segment != second->is_segment)
        return first->is_segment ? -1 : 1;
    return (first->number > second->number) - (first->number < second->number);
}

/* Logarithm of the odds that a lamp is there, of which one is expected among `count` candidates, if the loss is `gain`
 * lower with it. How alike patches are is measured with it: without, what it lights agrees. */
static double log_odds(const struct light_model *m, double gain, size_t count) {
    return gain / light_model_alike_last(m) - log((double)count);
}

/* Sorts the first `count` candidates by what each gains with all other sources as they are. */
static void sort_candidates(struct lamp_search *s, size_t count) {
    parallel_for(s->m->r->pool, count, try_candidate, s);
    qsort(s->candidate, count, sizeof *s->candidate, by_gain);
}

/* Sorts the likeliest candidate to the front. */
static void find_likeliest(struct lamp_search *s) {
    size_t likeliest = s->count < LIKELIEST ? s->count : LIKELIEST;
    sort_candidates(s, s->was_tried && s->count > AGAIN ? AGAIN : s->count);
    s->was_tried = true;
    for (size_t i = 0; i < likeliest; i++) {
        if (!s->candidate[i].is_whole)
            respond(s, &s->candidate[i], SEGMENT_LIGHT_POINTS);
    }
    sort_candidates(s, likeliest);
}

/* A candidate, the fit's last source, is a lamp. */
static void take_lamp(struct lamp_search *s, struct lamp_candidate *c) {
    if (c->is_segment) {
        struct light_lamp *lamp = light_lamps_add_hidden(&s->m->lamps, c->number);
        lamp->source = s->m->fit.source_count - 1, lamp->column = c->column;
    } else {
        s->part[s->part_count++] = c->number;
        mem_free(c->column);
    }
}

/* Fits the likeliest candidate together with all sources; false, and all as it was, where the evidence for it does not
 * suffice. */
static bool add_likeliest(struct lamp_search *s) {
    struct light_model *m = s->m;
    double without = joint_fit_loss(&m->fit);
    find_likeliest(s);
    struct lamp_candidate *best = &s->candidate[0];
    if (!(best->gain > 0.0))
        return false;
    size_t bytes = m->fit.source_count * sizeof *m->fit.source;
    struct joint_source *kept = mem_array(m->fit.source_count, sizeof *kept);
    memcpy(kept, m->fit.source, bytes);
    joint_fit_add(&m->fit, &best->source, best->column);
    bool is_likely = log_odds(m, without - joint_fit_solve(&m->fit), s->count) > log(SURE);
    if (is_likely) {
        take_lamp(s, best);
        *best = s->candidate[--s->count];
    } else {
        joint_fit_remove_last(&m->fit);
        memcpy(m->fit.source, kept, bytes);
    }
    mem_free(kept);
    return is_likely;
}

/* Takes what unseen_lamps.h added as lamps, for which the evidence sufficed. */
static void take_added(struct lamp_search *s) {
    size_t sources = s->m->fit.source_count;
    for (size_t i = s->count; i-- > 0;) {
        struct lamp_candidate *c = &s->candidate[i];
        if (!c->is_segment || !segment_range_has(&s->m->r->unseen_lamps, c->number))
            continue;
        respond(s, c, SEGMENT_LIGHT_POINTS);
        try_candidate(s, i, 0);
        joint_fit_add(&s->m->fit, &c->source, c->column);
        take_lamp(s, c);
        *c = s->candidate[--s->count];
    }
    if (s->m->fit.source_count > sources)
        joint_fit_solve(&s->m->fit);
}

static void search(struct lamp_search *s) {
    struct light_model *m = s->m;
    size_t before = m->lamps.count;
    find_candidates(s);
    take_added(s);
    while (s->count > 0 && m->lamps.count - before + s->part_count < LIGHT_MAX && add_likeliest(s))
        continue;
    for (size_t i = 0; i < s->count; i++)
        mem_free(s->candidate[i].column);
    mem_free(s->candidate);
}

void hidden_lamps_find(struct light_model *m) {
    struct lamp_search s = {.m = m};
    search(&s);
}

size_t hidden_lamps_find_parts(struct light_model *m, const struct unseen_space *space, uint32_t part[LIGHT_MAX]) {
    struct lamp_search s = {.m = m, .space = space};
    search(&s);
    memcpy(part, s.part, s.part_count * sizeof *part);
    return s.part_count;
}
