/* missing_light.c -- see missing_light.h. */
#include "server/light/missing_light.h"

#include <math.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "server/light/albedo.h"

/* Strengths tried: from one on that adds this share of the light that is known to what is lit, on average, octaves apart;
 * then nearer and nearer to the best. */
#define FAINTEST 0.01
#define STRENGTHS 20
#define NEARER 5
/* Rounds in which the strength tells what places it is asked of, and they tell the strength. */
#define ROUNDS 4
/* Points of which the median of a segment is taken. */
#define MEDIAN_POINTS 512

static void ask_all(struct missing_light *m) {
    for (size_t i = 0; i < m->places->count; i++)
        m->weight[i] = 1.0f;
}

void missing_light_init(struct missing_light *m, const struct light_places *places, float white) {
    *m = (struct missing_light){.places = places, .max_albedo = white};
    m->base = mem_array(places->count + 1, sizeof *m->base);
    m->sorted = mem_array(places->count + 1, sizeof *m->sorted);
    m->weight = mem_array(places->count + 1, sizeof *m->weight);
    ask_all(m);
}

void missing_light_release(struct missing_light *m) {
    mem_free(m->weight);
    mem_free(m->sorted);
    mem_free(m->base);
    *m = (struct missing_light){0};
}

static float channel_of(rgb value, int channel) {
    return channel == MISSING_MEAN ? rgb_mean(value) : (&value.r)[channel];
}

/* The share of a place's light in a channel that a strength of the one that is tried would be. */
static float part_of(const struct light_place *p, float strength, int channel) {
    float light = strength * p->lit;
    return light > 0.0f ? light / (light + channel_of(p->white, channel)) : 0.0f;
}

/* Robust loss in [0, 1) (Geman and McClure). */
static double oddity(float off, float spread) {
    double e = (double)(off / spread);
    return e * e / (1.0 + e * e);
}

/* Median of base[first, end), of MEDIAN_POINTS of them at most. */
static float median_of(const struct missing_light *m, size_t first, size_t end) {
    size_t stride = (end - first + MEDIAN_POINTS - 1) / MEDIAN_POINTS, count = 0;
    for (size_t i = first; i < end; i += stride)
        m->sorted[count++] = m->base[i];
    return quantile(m->sorted, count, 0.5);
}

/* Fills base[first, end) with logarithms. */
static void find_base(const struct missing_light *m, size_t first, size_t end, float strength, int channel) {
    for (size_t i = first; i < end; i++) {
        const struct light_place *p = &m->places->place[i];
        m->base[i] = logf(channel_of(p->shown, channel) / (channel_of(p->white, channel) + strength * p->lit));
    }
}

/* Spread of base colours about a median: a highlight, not known yet, makes dark surfaces less alike. */
static float spread_about(float median) { return (float)ALBEDO_WITHIN + ALBEDO_HIGHLIGHT * expf(-median); }

/* Misfit of place i, given the median base colour of its segment. */
static double place_misfit(const struct missing_light *m, size_t i, float median, float spread) {
    double within = oddity(m->base[i] - median, spread);
    double beyond = oddity(fmaxf(m->base[i] - logf(m->max_albedo), 0.0f), (float)ALBEDO_PATCH);
    return (double)(m->weight[i] * m->places->place[i].weight) * (within + beyond);
}

/* Misfit of a segment. */
static double segment_misfit(const struct missing_light *m, size_t first, size_t end, float strength, int channel) {
    double sum = 0.0;
    find_base(m, first, end, strength, channel);
    float median = median_of(m, first, end), spread = spread_about(median);
    for (size_t i = first; i < end; i++)
        sum += place_misfit(m, i, median, spread);
    return sum;
}

/* Misfit of all segments that the light reaches. */
static double misfit(const struct missing_light *m, float strength, int channel) {
    double sum = 0.0;
    for (size_t first = 0, end; first < m->places->count; first = end) {
        bool any = false;
        end = light_places_end(m->places, first);
        for (size_t i = first; i < end; i++)
            any = any || m->places->place[i].lit > 0.0f;
        if (any)
            sum += segment_misfit(m, first, end, strength, channel);
    }
    return sum;
}

static float faintest_strength(const struct missing_light *m, int channel) {
    double light = 0.0, lit = 0.0, lit_count = 0.0;
    for (size_t i = 0; i < m->places->count; i++) {
        light += (double)channel_of(m->places->place[i].white, channel);
        lit += (double)m->places->place[i].lit;
        lit_count += m->places->place[i].lit > 0.0f;
    }
    return lit > 0.0 ? (float)(FAINTEST * light / (double)m->places->count * lit_count / lit) : 0.0f;
}

float missing_light_strength(const struct missing_light *m, int channel, double *explained) {
    double without = misfit(m, 0.0f, channel), least = without;
    float best = 0.0f, step = 2.0f, strength = faintest_strength(m, channel);
    for (int i = 0; i < STRENGTHS; i++, strength *= 2.0f) {
        double here = misfit(m, strength, channel);
        if (here < least)
            least = here, best = strength;
    }
    for (int i = 0; i < NEARER && best > 0.0f; i++) {
        step = sqrtf(step);
        float middle = best;
        for (int side = -1; side <= 1; side += 2) {
            float other = side < 0 ? middle / step : middle * step;
            double here = misfit(m, other, channel);
            if (here < least)
                least = here, best = other;
        }
    }
    *explained = without - least;
    return best;
}

static void ask_by_share(struct missing_light *m, float strength, int channel) {
    for (size_t i = 0; i < m->places->count; i++) {
        float share = part_of(&m->places->place[i], strength, channel);
        m->weight[i] = share * share;
    }
}

static float strength_by_share(struct missing_light *m, int channel) {
    double explained;
    float strength = missing_light_strength(m, channel, &explained);
    for (int i = 0; i < ROUNDS && strength > 0.0f; i++) {
        ask_by_share(m, strength, channel);
        strength = missing_light_strength(m, channel, &explained);
    }
    ask_all(m);
    return strength;
}

rgb missing_light_color(struct missing_light *m) {
    float r = strength_by_share(m, 0), g = strength_by_share(m, 1);
    return rgb_make(r, g, strength_by_share(m, 2));
}
