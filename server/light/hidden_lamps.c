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
/* Odds that are asked of a lamp: a false one costs more than a missed one. */
#define SURE 20.0

struct lamp_candidate {
    uint32_t segment;
    double gain;   /* nats */
    bool is_whole; /* `column` is that of light_model_respond_hidden, and not of SCREEN_POINTS */
    float *column; /* of the response; owned */
    struct joint_source source;
};

struct lamp_search {
    struct light_model *m;
    size_t count;
    struct lamp_candidate *candidate;
};

/* --- candidates -------------------------------------------------------------------------------------------- */

/* No photograph shows it, and it has a surface. */
static bool may_be_lamp(const struct light_model *m, size_t segment) {
    const struct emitter_evidence *e = &m->r->evidence[segment];
    return !e->is_seen && !e->is_outshone && !m->lamps.is_lamp[segment] && m->lamps.light.area_m2[segment] > 0.0f;
}

bool hidden_lamps_any(const struct light_model *m) {
    bool any = false;
    for (size_t i = 0; i < m->r->segments.count; i++)
        any = any || may_be_lamp(m, i);
    return any;
}

static void find_candidates(struct lamp_search *s) {
    const struct light_model *m = s->m;
    s->candidate = mem_calloc(m->r->segments.count + 1, sizeof *s->candidate);
    for (size_t i = 0; i < m->r->segments.count; i++) {
        if (!may_be_lamp(m, i))
            continue;
        struct lamp_candidate *c = &s->candidate[s->count++];
        c->segment = (uint32_t)i;
        c->column = mem_calloc(m->points.count + 1, sizeof *c->column);
        segment_light_add(&m->lamps.light, m->points.point, m->points.count, c->segment, SCREEN_POINTS, c->column);
    }
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
    return (first->segment > second->segment) - (first->segment < second->segment);
}

/* Logarithm of the odds that a lamp is there, of which one is expected among `count` candidates, if the loss is `gain`
 * lower with it. How alike patches are is measured with it: without, what it lights agrees. */
static double log_odds(struct light_model *m, double gain, size_t count) {
    light_model_measure(m);
    return gain / m->patches_alike - log((double)count);
}

/* Sorts the first `count` candidates by what each gains with all other sources as they are. */
static void sort_candidates(struct lamp_search *s, size_t count) {
    parallel_for(s->m->r->pool, count, try_candidate, s);
    qsort(s->candidate, count, sizeof *s->candidate, by_gain);
}

/* Sorts the likeliest candidate to the front. */
static void find_likeliest(struct lamp_search *s) {
    size_t likeliest = s->count < LIKELIEST ? s->count : LIKELIEST;
    sort_candidates(s, s->count);
    for (size_t i = 0; i < likeliest; i++) {
        struct lamp_candidate *c = &s->candidate[i];
        if (c->is_whole)
            continue;
        memset(c->column, 0, s->m->points.count * sizeof *c->column);
        light_model_respond_hidden(s->m, c->segment, c->column);
        c->is_whole = true;
    }
    sort_candidates(s, likeliest);
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
        struct light_lamp *lamp = light_lamps_add_hidden(&m->lamps, best->segment);
        lamp->source = m->fit.source_count - 1, lamp->column = best->column;
        *best = s->candidate[--s->count];
    } else {
        joint_fit_remove_last(&m->fit);
        memcpy(m->fit.source, kept, bytes);
    }
    mem_free(kept);
    return is_likely;
}

void hidden_lamps_find(struct light_model *m) {
    struct lamp_search s = {.m = m};
    size_t before = m->lamps.count;
    find_candidates(&s);
    while (s.count > 0 && m->lamps.count - before < LIGHT_MAX && add_likeliest(&s))
        continue;
    for (size_t i = 0; i < s.count; i++)
        mem_free(s.candidate[i].column);
    mem_free(s.candidate);
}
