/* lamp_find.c -- see lamp_find.h. */
#include "server/light/lamp_find.h"

#include <math.h>
#include <stdlib.h>

#include "common/mem.h"
#include "server/light/emitters.h"
#include "server/light/lamps.h"
#include "server/state/evidence.h"

/* So many places of the room ask every segment that was not seen, and few points of it; all places ask the
 * likeliest of them. */
#define FEW_PLACES 2048
#define FEW_POINTS 8
#define LIKELIEST 16
/* A small and very bright lamp is less likely than a larger one: what it explains counts so much less for each
 * power of ten by which it outshines the room. */
#define UNLIKELY 0.2
/* A lamp must explain this share of what is odd in the room, and bring this share of its light. Of those that were
 * hidden from the photographs of staircase2, bathroom and the demo room five explain .13 to .7; other segments of these
 * and of redkitchen .10 at most, which is more than the light below staircase2's stairs does (.05). */
#define EXPLAINS 0.105
#define BRINGS 0.02
/* Where one looks out of the room in so many directions that no photograph shows the sky may as well be what is
 * missing (unseen_light.h), and a lamp must explain more: staircase2's windows do .32 and .44, a lamp in the place of
 * the sky .23. */
#define EXPLAINS_OPEN 0.28
/* Or, one of several lamps, this share only, if nearly all of what it lights more than all others do is odd without it
 * and as usual with it: of so many places at least it leaves this part of what is odd at most (of kitchen's lamps
 * .17 to .26; of other segments .6 and more, where a sun is still to be found .36). */
#define EXPLAINS_ONE_OF_MANY 0.03
#define MAINLY 0.5f
#define MAINLY_PLACES 30.0
#define LEAVES 0.3

/* A segment that no photograph shows. */
struct lamp_candidate {
    uint32_t segment;
    float strength;
    double explained, brings; /* in places */
};

struct lamp_search {
    bool is_open;       /* one looks out of it to where no photograph does */
    struct lamps lamps; /* that were found; and all places */
    struct light_places few;
    size_t candidate_count;
    struct lamp_candidate *candidate; /* [candidate_count]; owned */
};

/* --- candidates -------------------------------------------------------------------------------------------- */

static void find_candidates(struct lamp_search *s, const struct views *views) {
    const struct reconstruction *r = s->lamps.r;
    emitters_observe(r, views, r->evidence);
    s->candidate = mem_array(r->segments.count + 1, sizeof *s->candidate);
    for (size_t i = 0; i < r->segments.count; i++) {
        if (!r->evidence[i].is_seen && s->lamps.light.texels.first[i + 1] > s->lamps.light.texels.first[i])
            s->candidate[s->candidate_count++] = (struct lamp_candidate){.segment = (uint32_t)i};
    }
}

/* Sum over places of the part of their light that would come from one source. */
static double brought(const struct light_places *places, float strength) {
    double sum = 0.0;
    for (size_t i = 0; i < places->count; i++)
        sum += (double)(places->place[i].weight * missing_light_part(&places->place[i], strength));
    return sum;
}

static void ask(const struct lamp_search *s, const struct missing_light *m, struct light_places *places,
                struct lamp_candidate *c, size_t points) {
    segment_light_places(&s->lamps.light, places, c->segment, points);
    c->strength = missing_light_strength(m, MISSING_MEAN, &c->explained);
    c->explained /= 1.0 + UNLIKELY * fmax(log10((double)(c->strength / s->lamps.median_radiance)), 0.0);
    c->brings = brought(places, c->strength);
}

static int by_explained(const void *a, const void *b) {
    const struct lamp_candidate *first = a, *second = b;
    if (first->explained != second->explained)
        return first->explained < second->explained ? 1 : -1;
    return (first->segment > second->segment) - (first->segment < second->segment);
}

/* Misfit over the places that the candidate lights more than all others do. */
static bool puts_right(struct lamp_search *s, const struct lamp_candidate *c) {
    segment_light_places(&s->lamps.light, &s->lamps.places, c->segment, SEGMENT_LIGHT_POINTS);
    struct missing_share mainly = missing_light_share(&s->lamps.missing, c->strength, MAINLY);
    return mainly.count > MAINLY_PLACES && mainly.after < LEAVES * mainly.before;
}

static bool is_lamp(struct lamp_search *s, const struct lamp_candidate *c) {
    double weight = 0.0, share = c->explained / fmax(missing_light_misfit(&s->lamps.missing), 1e-30);
    for (size_t i = 0; i < s->lamps.places.count; i++)
        weight += (double)s->lamps.places.place[i].weight;
    if (!(c->brings > BRINGS * weight))
        return false;
    if (s->is_open)
        return share > EXPLAINS_OPEN;
    return share > EXPLAINS || (share > EXPLAINS_ONE_OF_MANY && puts_right(s, c));
}

/* Moves the segment that reduces misfit most to the front; false if it is not enough. */
static bool find_best(struct lamp_search *s) {
    struct missing_light few;
    missing_light_init(&few, &s->few, LAMPS_WHITEST, false);
    for (size_t i = 0; i < s->candidate_count; i++)
        ask(s, &few, &s->few, &s->candidate[i], FEW_POINTS);
    missing_light_release(&few);
    qsort(s->candidate, s->candidate_count, sizeof *s->candidate, by_explained);
    size_t likeliest = s->candidate_count < LIKELIEST ? s->candidate_count : LIKELIEST;
    for (size_t i = 0; i < likeliest; i++)
        ask(s, &s->lamps.missing, &s->lamps.places, &s->candidate[i], SEGMENT_LIGHT_POINTS);
    qsort(s->candidate, likeliest, sizeof *s->candidate, by_explained);
    return likeliest > 0 && is_lamp(s, &s->candidate[0]);
}

/* --- lamps ------------------------------------------------------------------------------------------------- */

/* Makes a lamp of the first candidate. */
static void add_lamp(struct lamp_search *s) {
    struct lamp *lamp = lamps_add(&s->lamps, s->candidate[0].segment, rgb_gray(0.0f));
    s->candidate[0] = s->candidate[--s->candidate_count];
    lamps_fit_one(&s->lamps, lamp);
    missing_light_renew(&s->lamps.missing);
    segment_light_places(&s->lamps.light, &s->few, lamp->segment[0], SEGMENT_LIGHT_POINTS);
    lamps_shine(&s->few, lamp->radiance);
}

static void look_for_lamps(struct lamp_search *s) {
    while (s->lamps.count < LAMPS_MOST && find_best(s))
        add_lamp(s);
    lamps_fit_all(&s->lamps, s->lamps.count);
}

/* --- the whole --------------------------------------------------------------------------------------------- */

static void report(const struct lamps *l) {
    cJSON *list = cJSON_AddArrayToObject(l->r->report, "hidden_lamps");
    for (size_t i = 0; i < l->count; i++)
        cJSON_AddItemToArray(list, cJSON_CreateNumber((double)l->r->segments.id[l->lamp[i].segment[0]]));
}

void lamp_find(struct reconstruction *r, const struct views *views) {
    struct lamp_search s = {0};
    lamps_init(&s.lamps, r, views);
    find_candidates(&s, views);
    if (s.candidate_count > 0) {
        lamps_survey(&s.lamps, views, NULL, NULL);
        light_places_thin(&s.few, &s.lamps.places, FEW_PLACES);
        s.is_open = lamps_is_open(&s.lamps);
        look_for_lamps(&s);
    }
    report(&s.lamps);
    lamps_hand_over(&s.lamps, s.lamps.count);
    mem_free(s.candidate);
    light_places_release(&s.few);
    lamps_release(&s.lamps);
}
