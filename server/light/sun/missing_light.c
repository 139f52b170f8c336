/* missing_light.c -- see missing_light.h. */
#include "server/light/sun/missing_light.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "server/light/light_priors.h"

/* Rounds of weights by the last strength, and of the strength by these weights. */
#define ROUNDS 4

static void weigh_equally(struct missing_light *m) {
    for (size_t i = 0; i < m->places->count; i++)
        m->weight[i] = 1.0f;
}

static void find_segments(struct missing_light *m) {
    m->first = mem_array(m->places->count + 1, sizeof *m->first);
    for (size_t first = 0; first < m->places->count; first = light_places_end(m->places, first))
        m->first[m->segment_count++] = first;
    m->first[m->segment_count] = m->places->count;
}

void missing_light_init(struct missing_light *m, const struct light_places *places, struct parallel *pool) {
    *m = (struct missing_light){.places = places, .pool = pool};
    find_segments(m);
    m->base = mem_array(STRENGTHS * places->count + 1, sizeof *m->base);
    m->sorted = mem_array(STRENGTHS * places->count + 1, sizeof *m->sorted);
    m->misfit = mem_array(STRENGTHS * m->segment_count + 1, sizeof *m->misfit);
    m->weight = mem_array(places->count + 1, sizeof *m->weight);
    weigh_equally(m);
}

void missing_light_release(struct missing_light *m) {
    mem_free(m->first);
    mem_free(m->weight);
    mem_free(m->misfit);
    mem_free(m->sorted);
    mem_free(m->base);
    *m = (struct missing_light){0};
}

static float channel_of(rgb value, int channel) {
    return channel == MISSING_MEAN ? rgb_mean(value) : (&value.r)[channel];
}

/* The share of a place's light in a channel that a strength of the one that is tried would be. */
static float part_of(const struct light_place *p, float strength, int channel) {
    float light = strength * p->response;
    return light > 0.0f ? light / (light + channel_of(p->lambert, channel)) : 0.0f;
}

/* Robust loss in [0, 1) (Geman and McClure). */
static double robust_loss(float residual, float spread) {
    double e = (double)(residual / spread);
    return e * e / (1.0 + e * e);
}

/* Fills base[count] with logarithms. */
static void find_base(const struct light_place *place, size_t count, float strength, int channel, float *base) {
    for (size_t i = 0; i < count; i++)
        base[i] = logf(channel_of(place[i].observed, channel) /
                       (channel_of(place[i].lambert, channel) + strength * place[i].response));
}

/* Spread of base colours about a median, of points and patches: a highlight, not known yet, makes dark surfaces less
 * alike. */
static float spread_about(float median) {
    return hypotf((float)ALBEDO_POINT, (float)ALBEDO_PATCH) + ALBEDO_HIGHLIGHT * expf(-median);
}

/* Misfit of place i, given its base colour's logarithm and the median of its segment's. */
static double place_misfit(const struct missing_light *m, size_t i, float base, float median, float spread) {
    double within = robust_loss(base - median, spread);
    double beyond = robust_loss(fmaxf(base - logf((float)ALBEDO_WHITE), 0.0f), (float)ALBEDO_PATCH);
    return (double)(m->weight[i] * m->places->place[i].weight) * (within + beyond);
}

struct strengths {
    const struct missing_light *m;
    int channel;
    const double *strength;
};

/* Misfit of a segment at a strength; 0 where the light does not reach it. */
static void find_misfit(void *user, size_t index, int thread) {
    const struct strengths *s = user;
    const struct missing_light *m = s->m;
    size_t row = index / m->segment_count, segment = index % m->segment_count;
    size_t first = m->first[segment], count = m->first[segment + 1] - first;
    float *base = m->base + row * m->places->count + first, *sorted = m->sorted + row * m->places->count + first;
    bool any = false;
    (void)thread;
    m->misfit[index] = 0.0;
    for (size_t i = first; i < first + count; i++)
        any = any || m->places->place[i].response > 0.0f;
    if (!any)
        return;
    find_base(m->places->place + first, count, (float)s->strength[row], s->channel, base);
    memcpy(sorted, base, count * sizeof *sorted);
    float median = quantile(sorted, count, 0.5), spread = spread_about(median);
    for (size_t i = 0; i < count; i++)
        m->misfit[index] += place_misfit(m, first + i, base[i], median, spread);
}

/* Misfit of all segments that the light reaches. */
static void misfits(void *user, const double *strength, size_t count, double *misfit) {
    struct strengths *s = user;
    const struct missing_light *m = s->m;
    s->strength = strength;
    parallel_for(m->pool, count * m->segment_count, find_misfit, s);
    for (size_t row = 0; row < count; row++) {
        misfit[row] = 0.0;
        for (size_t k = 0; k < m->segment_count; k++)
            misfit[row] += m->misfit[row * m->segment_count + k];
    }
}

float missing_light_strength(const struct missing_light *m, int channel, double *explained) {
    struct strengths s = {.m = m, .channel = channel};
    double known = 0.0, response = 0.0, best;
    for (size_t i = 0; i < m->places->count; i++) {
        const struct light_place *p = &m->places->place[i];
        known += p->response > 0.0f ? (double)channel_of(p->lambert, channel) : 0.0;
        response += (double)p->response;
    }
    *explained = strength_search(known, response, misfits, &s, &best);
    return (float)best;
}

static void weigh_by_share(struct missing_light *m, float strength, int channel) {
    for (size_t i = 0; i < m->places->count; i++) {
        float share = part_of(&m->places->place[i], strength, channel);
        m->weight[i] = share * share;
    }
}

static float strength_by_share(struct missing_light *m, int channel) {
    double explained;
    float strength = missing_light_strength(m, channel, &explained);
    for (int i = 0; i < ROUNDS && strength > 0.0f; i++) {
        weigh_by_share(m, strength, channel);
        strength = missing_light_strength(m, channel, &explained);
    }
    weigh_equally(m);
    return strength;
}

rgb missing_light_color(struct missing_light *m) {
    float r = strength_by_share(m, 0), g = strength_by_share(m, 1);
    return rgb_make(r, g, strength_by_share(m, 2));
}
