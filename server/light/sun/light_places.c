/* light_places.c -- see light_places.h. */
#include "server/light/sun/light_places.h"

#include <math.h>
#include <stdlib.h>

#include "common/mem.h"
#include "common/quantile.h"

#define RAYS_PER_POINT 128 /* directions a point */
/* Bound of a residual, in the logarithm of base colour: a factor of e. */
#define MAX_RESIDUAL 1.0f

struct places_gathering {
    const struct survey *survey;
    struct light_place *place; /* [survey->count] */
};

static void gather_place(void *user, size_t index, int thread) {
    const struct places_gathering *g = user;
    const struct survey *survey = g->survey;
    const struct reconstruction *r = survey->r;
    struct light_place *p = &g->place[index];
    uint32_t texel = survey->texel[index];
    struct irradiance light;
    *p = (struct light_place){.segment = reconstruction_segment(r, texel),
                              .observed = survey_observed(survey, &r->fused, texel),
                              .weight = 1.0f};
    if (survey_gather(survey, texel, RAYS_PER_POINT, thread, &p->at, &light))
        p->lambert = survey_lambert(&p->at, &light);
}

static int by_segment(const void *a, const void *b) {
    const struct light_place *first = a, *second = b;
    if (first->segment != second->segment)
        return first->segment < second->segment ? -1 : 1;
    return (first->at.triangle > second->at.triangle) - (first->at.triangle < second->at.triangle);
}

size_t light_places_end(const struct light_places *s, size_t first) {
    size_t end = first;
    while (end < s->count && s->place[end].segment == s->place[first].segment)
        end++;
    return end;
}

size_t light_places_above(const struct light_places *s, float residual) {
    size_t count = 0;
    for (size_t i = 0; i < s->count; i++)
        count += s->place[i].residual > residual;
    return count;
}

/* Adds a little light everywhere, which keeps logarithms finite. */
static void floor_light(struct light_places *s) {
    float *mean = mem_array(s->count + 1, sizeof *mean);
    for (size_t i = 0; i < s->count; i++)
        mean[i] = rgb_mean(s->place[i].observed);
    float dark = fmaxf(SURVEY_DARK * quantile(mean, s->count, 0.5), 1e-20f);
    for (size_t i = 0; i < s->count; i++) {
        s->place[i].observed = rgb_add(s->place[i].observed, rgb_gray(dark));
        s->place[i].lambert = rgb_add(s->place[i].lambert, rgb_gray(dark));
    }
    mem_free(mean);
}

static float log_base(const struct light_place *p) { return logf(rgb_mean(p->observed) / rgb_mean(p->lambert)); }

void light_places_leave_out_lamps(struct light_places *s) {
    size_t kept = 0;
    for (size_t first = 0, end; first < s->count; first = end) {
        size_t bright = 0;
        end = light_places_end(s, first);
        for (size_t i = first; i < end; i++)
            bright += log_base(&s->place[i]) > logf((float)ALBEDO_WHITE) + PLACE_BRIGHT;
        for (size_t i = first; i < end && 2 * bright < end - first; i++)
            s->place[kept++] = s->place[i];
    }
    s->count = kept;
}

static void find_residuals(struct light_places *s) {
    float *sorted = mem_array(s->count + 1, sizeof *sorted);
    for (size_t first = 0, end; first < s->count; first = end) {
        end = light_places_end(s, first);
        for (size_t i = first; i < end; i++)
            sorted[i - first] = log_base(&s->place[i]);
        float median = quantile(sorted, end - first, 0.5);
        for (size_t i = first; i < end; i++) {
            float log = log_base(&s->place[i]);
            s->place[i].residual =
                clampf(fmaxf(log - median, log - logf((float)ALBEDO_WHITE)), -MAX_RESIDUAL, MAX_RESIDUAL);
        }
    }
    mem_free(sorted);
}

void light_places_take(struct light_places *s, struct light_place *place, size_t count) {
    *s = (struct light_places){.count = count, .place = place};
    qsort(s->place, s->count, sizeof *s->place, by_segment);
    floor_light(s);
    find_residuals(s);
}

void light_places_init(struct light_places *s, const struct survey *survey) {
    struct light_place *place = mem_array(survey->count + 1, sizeof *place);
    parallel_for(survey->r->pool, survey->count, gather_place, &(struct places_gathering){survey, place});
    light_places_take(s, place, survey->count);
}

void light_places_release(struct light_places *s) {
    mem_free(s->place);
    *s = (struct light_places){0};
}
