/* hidden_lamps.c -- see hidden_lamps.h. */
#include "server/light/hidden_lamps.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "server/state/evidence.h"

/* Points of a candidate that represent its area while all are screened; the likeliest get SEGMENT_LIGHT_POINTS. */
#define SCREEN_POINTS 8
/* Candidates that are tried with their whole response, half of which are fitted together with all other sources. */
#define LIKELIEST 8
/* Logarithm of the odds that are asked for: 20 to 1, as a false lamp costs more than a missed one. */
#define SURE 3.0
#define NO_LIGHT (-1e3) /* the logarithm of no radiance to speak of */

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

/* Logarithm of the odds that a lamp is there, of which one is expected among `count` candidates, over those that are
 * asked for, if the loss is `gain` lower with it. How alike patches are is measured with it: without, what it lights
 * agrees. */
static double odds(struct light_model *m, double gain, size_t count) {
    light_model_measure(m);
    return gain / m->patches_alike - log((double)count) - SURE;
}

/* Gives what unseen surfaces send its prior value: it must not keep explaining what a lamp explains better. */
static void reset_regions(struct joint_fit *fit, size_t first) {
    for (size_t k = first; k < first + LIGHT_REGIONS; k++)
        fit->source[k].value = fit->source[k].mean;
}

/* Sorts the first `count` candidates by what each gains with all other sources as they are. */
static void sort_candidates(struct lamp_search *s, size_t count) {
    reset_regions(&s->m->fit, s->m->first_region);
    parallel_for(s->m->r->pool, count, try_candidate, s);
    qsort(s->candidate, count, sizeof *s->candidate, by_gain);
}

/* Sorts the likeliest candidates to the front; returns how many are to be fitted. */
static size_t find_likeliest(struct lamp_search *s) {
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
    return likeliest < LIKELIEST / 2 ? likeliest : LIKELIEST / 2;
}

/* Fits the likeliest candidates each together with all sources; adds the best one if the evidence suffices. */
static bool add_best(struct lamp_search *s) {
    struct light_model *m = s->m;
    size_t sources = m->fit.source_count, best = SIZE_MAX, bytes = (sources + 1) * sizeof *m->fit.source;
    struct joint_source *kept = mem_array(sources + 1, sizeof *kept), *fitted = mem_array(sources + 1, sizeof *fitted);
    double without = joint_fit_loss(&m->fit), greatest = 0.0;
    memcpy(kept, m->fit.source, bytes - sizeof *kept);
    size_t likeliest = find_likeliest(s);
    for (size_t i = 0; i < likeliest && s->candidate[i].gain > 0.0; i++) {
        joint_fit_add(&m->fit, &s->candidate[i].source, s->candidate[i].column);
        double likely = odds(m, without - joint_fit_solve(&m->fit, JOINT_STEPS_NEAR), s->count);
        if (likely > greatest) {
            greatest = likely, best = i;
            memcpy(fitted, m->fit.source, bytes);
        }
        joint_fit_remove(&m->fit, sources);
        memcpy(m->fit.source, kept, bytes - sizeof *kept);
        reset_regions(&m->fit, m->first_region);
    }
    memcpy(m->fit.source, kept, bytes - sizeof *kept);
    if (best < SIZE_MAX) {
        struct lamp_candidate *c = &s->candidate[best];
        light_model_add_hidden(m, c->segment, &c->source, c->column);
        memcpy(m->fit.source, fitted, bytes);
        *c = s->candidate[--s->count];
    }
    mem_free(fitted);
    mem_free(kept);
    return best < SIZE_MAX;
}

/* --- the whole --------------------------------------------------------------------------------------------- */

/* Takes a lamp back that the others make superfluous; false where there is none. */
static bool remove_one(struct lamp_search *s) {
    struct light_model *m = s->m;
    double with = joint_fit_loss(&m->fit);
    for (size_t i = 0; i < m->lamps.count; i++) {
        const struct light_lamp *lamp = &m->lamps.lamp[i];
        if (lamp->kind != ESTIMATED_HIDDEN)
            continue;
        struct joint_source *source = &m->fit.source[lamp->source], kept = *source;
        source->value = source->mean = NO_LIGHT;
        double gain = joint_fit_loss(&m->fit) - with;
        *source = kept;
        if (odds(m, gain, s->count + 1) > 0.0)
            continue;
        light_model_remove_hidden(m, i);
        joint_fit_solve(&m->fit, JOINT_STEPS_NEAR);
        return true;
    }
    return false;
}

void hidden_lamps_find(struct light_model *m) {
    struct lamp_search s = {.m = m};
    size_t before = m->lamps.count;
    find_candidates(&s);
    while (s.count > 0 && m->lamps.count - before < LIGHT_MAX && add_best(&s))
        continue;
    while (m->lamps.count > before && remove_one(&s))
        continue;
    for (size_t i = 0; i < s.count; i++)
        mem_free(s.candidate[i].column);
    mem_free(s.candidate);
}
