/* sun_places.c -- see sun_places.h. */
#include "server/reconstruct/sun_places.h"

#include <math.h>
#include <stdlib.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "server/reconstruct/survey.h"
#include "server/render/sampler.h"

#define POINTS 16384
#define WAYS 128 /* directions a point */
#define KEY_SUN 29 /* keeps these random numbers apart from others of the texel */
/* Logarithms of base colour: what of it is odd counts up to this much. */
#define ODD_MOST 1.0f
/* Light beside which this share of the room's median is nothing. */
#define DARK 0.01f

struct gathering {
    const struct survey *survey;
    struct sun_place *place; /* [survey->count] */
};

static void gather_place(void *user, size_t index, int thread) {
    const struct gathering *g = user;
    const struct survey *survey = g->survey;
    const struct reconstruction *r = survey->r;
    struct sun_place *p = &g->place[index];
    uint32_t texel = survey->texel[index];
    struct irradiance light;
    *p = (struct sun_place){.segment = reconstruction_segment(r, texel), .shown = fused_radiance(&r->fused, texel)};
    if (!surface_at_texel(&r->scene->mesh, &r->atlas, &r->inverse, texel, &p->at))
        return;
    irradiance_gather(&light, &survey->scratch[thread], &survey->field, &p->at, sampler_key(KEY_SUN, texel, 0), WAYS);
    p->white = irradiance_diffuse(&light, p->at.shading, 1.0f, p->at.shading);
}

static int by_segment(const void *a, const void *b) {
    const struct sun_place *first = a, *second = b;
    if (first->segment != second->segment)
        return first->segment < second->segment ? -1 : 1;
    return (first->at.triangle > second->at.triangle) - (first->at.triangle < second->at.triangle);
}

size_t sun_places_end(const struct sun_places *s, size_t first) {
    size_t end = first;
    while (end < s->count && s->place[end].segment == s->place[first].segment)
        end++;
    return end;
}

size_t sun_places_odder(const struct sun_places *s, float odd) {
    size_t count = 0;
    for (size_t i = 0; i < s->count; i++)
        count += s->place[i].odd > odd;
    return count;
}

/* Keeps light from being nothing. */
static void floor_light(struct sun_places *s) {
    float *mean = mem_array(s->count + 1, sizeof *mean);
    for (size_t i = 0; i < s->count; i++)
        mean[i] = rgb_mean(s->place[i].shown);
    float dark = fmaxf(DARK * quantile(mean, s->count, 0.5), 1e-20f);
    for (size_t i = 0; i < s->count; i++) {
        s->place[i].shown = rgb_add(s->place[i].shown, rgb_gray(dark));
        s->place[i].white = rgb_add(s->place[i].white, rgb_gray(dark));
    }
    mem_free(mean);
}

static float log_base(const struct sun_place *p) {
    return logf(rgb_mean(p->shown) / rgb_mean(p->white));
}

/* Leaves out segments of which most is brighter than white: lamps, for all one knows. */
static void leave_out_lamps(struct sun_places *s) {
    size_t kept = 0;
    for (size_t first = 0, end; first < s->count; first = end) {
        size_t bright = 0;
        end = sun_places_end(s, first);
        for (size_t i = first; i < end; i++)
            bright += log_base(&s->place[i]) > logf(SUN_WHITE) + SUN_BRIGHT;
        for (size_t i = first; i < end && 2 * bright < end - first; i++)
            s->place[kept++] = s->place[i];
    }
    s->count = kept;
}

static void find_odd(struct sun_places *s) {
    float *sorted = mem_array(s->count + 1, sizeof *sorted);
    for (size_t first = 0, end; first < s->count; first = end) {
        end = sun_places_end(s, first);
        for (size_t i = first; i < end; i++)
            sorted[i - first] = log_base(&s->place[i]);
        float median = quantile(sorted, end - first, 0.5);
        for (size_t i = first; i < end; i++) {
            float log = log_base(&s->place[i]);
            s->place[i].odd = clampf(fmaxf(log - median, log - logf(SUN_WHITE)), -ODD_MOST, ODD_MOST);
        }
    }
    mem_free(sorted);
}

void sun_places_init(struct sun_places *s, struct reconstruction *r, const struct views *views) {
    struct survey survey;
    survey_init(&survey, r, views, POINTS);
    *s = (struct sun_places){.count = survey.count, .place = mem_array(survey.count + 1, sizeof *s->place)};
    parallel_for(r->pool, s->count, gather_place, &(struct gathering){&survey, s->place});
    survey_release(&survey);
    qsort(s->place, s->count, sizeof *s->place, by_segment);
    floor_light(s);
    leave_out_lamps(s);
    find_odd(s);
}

void sun_places_release(struct sun_places *s) {
    mem_free(s->place);
    *s = (struct sun_places){0};
}
