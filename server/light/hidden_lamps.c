/* hidden_lamps.c -- see hidden_lamps.h. */
#include "server/light/hidden_lamps.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "common/spaced.h"
#include "server/state/evidence.h"

/* A few points of the room are asked about every candidate and few points of it; all are asked about the likeliest. */
#define FEW_POINTS 2048
#define FEW_SOURCE_POINTS 8
#define LIKELIEST 8 /* half of which are fitted together with all other sources */
/* Logarithm of the odds that are asked for: 20 to 1, as a false lamp costs more than a missed one. */
#define SURE 3.0
#define NO_LIGHT (-1e3) /* the logarithm of no radiance to speak of */

struct lamp_candidate {
    uint32_t segment;
    double gain;      /* nats */
    float *few, *all; /* columns of the response for the few and, when it was likely, for all points; owned */
    struct joint_source source;
};

struct lamp_search {
    struct light_model *m;
    size_t few_count;
    struct light_point *few;   /* [few_count] copies */
    struct joint_point *joint; /* [few_count] */
    struct joint_fit fit;      /* of these */
    size_t count;
    struct lamp_candidate *candidate;
    bool all; /* all points are asked in place of the few */
};

/* --- the few points ---------------------------------------------------------------------------------------- */

static void choose_few(struct lamp_search *s) {
    const struct light_model *m = s->m;
    s->few_count = m->points.count < FEW_POINTS ? m->points.count : FEW_POINTS;
    s->few = mem_array(s->few_count + 1, sizeof *s->few);
    s->joint = mem_array(s->few_count + 1, sizeof *s->joint);
    for (size_t i = 0; i < s->few_count; i++) {
        size_t from = spaced(i, m->points.count, s->few_count);
        s->few[i] = m->points.point[from];
        s->joint[i] = m->joint[from];
    }
}

/* Makes the fit of the few points one of the sources that there are by now. */
static void renew_few(struct lamp_search *s) {
    const struct light_model *m = s->m;
    float *column = mem_array(s->few_count + 1, sizeof *column);
    joint_fit_release(&s->fit);
    joint_fit_init(&s->fit, s->joint, s->few_count, m->fit.source_count, m->r->pool);
    s->fit.source[0] = m->fit.source[0];
    for (size_t j = 1; j < m->fit.source_count; j++) {
        for (size_t i = 0; i < s->few_count; i++)
            column[i] = m->fit.response[spaced(i, m->points.count, s->few_count) * m->fit.source_most + j];
        joint_fit_add(&s->fit, &m->fit.source[j], column);
    }
    mem_free(column);
}

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
        c->few = mem_calloc(s->few_count + 1, sizeof *c->few);
        segment_light_add(&m->lamps.light, s->few, s->few_count, c->segment, FEW_SOURCE_POINTS, c->few);
    }
}

static void try_candidate(void *user, size_t index, int thread) {
    (void)thread;
    const struct lamp_search *s = user;
    struct lamp_candidate *c = &s->candidate[index];
    c->source = light_lamps_hidden_prior(&s->m->lamps);
    c->gain = joint_fit_try(s->all ? &s->m->fit : &s->fit, &c->source, s->all ? c->all : c->few);
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

/* Sorts the likeliest candidates to the front, by what each gains with all other sources as they are. */
static size_t find_likeliest(struct lamp_search *s) {
    struct light_model *m = s->m;
    s->all = false;
    reset_regions(&s->fit, m->first_region);
    parallel_for(m->r->pool, s->count, try_candidate, s);
    qsort(s->candidate, s->count, sizeof *s->candidate, by_gain);
    size_t likeliest = s->count < LIKELIEST ? s->count : LIKELIEST;
    for (size_t i = 0; i < likeliest; i++) {
        struct lamp_candidate *c = &s->candidate[i];
        if (c->all)
            continue;
        c->all = mem_calloc(m->points.count + 1, sizeof *c->all);
        light_model_respond_hidden(m, c->segment, c->all);
    }
    s->all = true;
    reset_regions(&m->fit, m->first_region);
    parallel_for(m->r->pool, likeliest, try_candidate, s);
    qsort(s->candidate, likeliest, sizeof *s->candidate, by_gain);
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
        joint_fit_add(&m->fit, &s->candidate[i].source, s->candidate[i].all);
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
        light_model_add_hidden(m, c->segment, &c->source, c->all);
        memcpy(m->fit.source, fitted, bytes);
        mem_free(c->few);
        *c = s->candidate[--s->count];
        renew_few(s);
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
    choose_few(&s);
    find_candidates(&s);
    renew_few(&s);
    while (s.count > 0 && m->lamps.count - before < LIGHT_MOST && add_best(&s))
        continue;
    while (m->lamps.count > before && remove_one(&s))
        continue;
    for (size_t i = 0; i < s.count; i++) {
        mem_free(s.candidate[i].few);
        mem_free(s.candidate[i].all);
    }
    mem_free(s.candidate);
    joint_fit_release(&s.fit);
    mem_free(s.joint);
    mem_free(s.few);
}
