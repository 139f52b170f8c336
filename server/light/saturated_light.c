/* saturated_light.c -- see saturated_light.h. */
#include "server/light/saturated_light.h"

#include <math.h>
#include <stdlib.h>

#include "common/mem.h"
#include "server/light/emitters.h"
#include "server/light/lamps.h"
#include "server/state/evidence.h"

/* Least reduction of the room's misfit, relative, by a brighter lamp; higher in open rooms (lamps_is_open). One of
 * staircase2's lamps has .12 there; a box in redkitchen, most of whose light is from unobserved directions, .04. */
#define EXPLAINS 0.01
#define EXPLAINS_OPEN 0.08
/* Greatest credible ratio of a lamp's radiance to the level at which its photographs saturate. */
#define TOO_BRIGHT 1000.0f
/* The sky is asked for where this share of what is seen of it saturates: else what is unseen of it was not filled in
 * from a bound, and is unseen_light.h's. */
#define SKY_SATURATED 0.5

/* A saturated segment, and its power. */
struct saturated {
    uint32_t segment;
    double power;
};

static bool is_saturated(const struct emitter_evidence *e) {
    return e->is_seen && (e->saturated[0] || e->saturated[1] || e->saturated[2]);
}

static int by_power(const void *a, const void *b) {
    const struct saturated *first = a, *second = b;
    if (first->power != second->power)
        return first->power < second->power ? 1 : -1;
    return (first->segment > second->segment) - (first->segment < second->segment);
}

/* The saturated segments of the greatest power, at most LAMPS_MOST. */
static void add_segments(struct lamps *l) {
    const struct reconstruction *r = l->r;
    struct saturated *found = mem_array(r->segments.count + 1, sizeof *found);
    size_t count = 0;
    for (size_t i = 0; i < r->segments.count; i++) {
        const struct emitter_evidence *e = &r->evidence[i];
        if (is_saturated(e))
            found[count++] = (struct saturated){(uint32_t)i, (double)(rgb_mean(e->radiance) * l->light.area_m2[i])};
    }
    qsort(found, count, sizeof *found, by_power);
    for (size_t i = 0; i < count && l->count < LAMPS_MOST; i++)
        lamps_add_bound(l, found[i].segment);
    mem_free(found);
}

/* Moves the lamp that reduces misfit most to `first`; false if it is not enough. */
static bool find_best(struct lamps *l, size_t first, double least_share) {
    double most = 0.0;
    size_t best = first;
    for (size_t i = first; i < l->count; i++) {
        double explained;
        float missing = lamps_missing(l, &l->lamp[i], &explained);
        bool is_credible = missing < TOO_BRIGHT * rgb_mean(l->lamp[i].least);
        if (is_credible && explained > most)
            most = explained, best = i;
    }
    if (!(most > least_share * missing_light_misfit(&l->missing)))
        return false;
    struct lamp lamp = l->lamp[best];
    l->lamp[best] = l->lamp[first];
    l->lamp[first] = lamp;
    return true;
}

/* Brightens lamps for as long as one reduces misfit enough; returns their number, the first ones. */
static size_t brighten(struct lamps *l) {
    size_t count = 0;
    double least_share = lamps_is_open(l) ? EXPLAINS_OPEN : EXPLAINS;
    while (count < l->count && find_best(l, count, least_share)) {
        lamps_fit_one(l, &l->lamp[count++]);
        missing_light_renew(&l->missing);
    }
    return count;
}

static void report(const struct lamps *l, size_t count) {
    cJSON *list = cJSON_AddArrayToObject(l->r->report, "saturated_light");
    for (size_t i = 0; i < count; i++) {
        const struct lamp *lamp = &l->lamp[i];
        for (size_t k = 0; k < lamp->segment_count; k++) {
            cJSON *entry = cJSON_CreateObject();
            if (!lamps_is_sky(lamp))
                json_add_number(entry, "object_id", (double)l->r->segments.id[lamp->segment[k]]);
            json_add_number(entry, "factor", (double)(rgb_mean(lamp->radiance) / rgb_mean(lamp->least)));
            cJSON_AddItemToArray(list, entry);
        }
    }
}

void saturated_light_estimate(struct reconstruction *r, const struct views *views) {
    struct lamps lamps;
    size_t brighter = 0;
    lamps_init(&lamps, r, views);
    emitters_observe(r, views, r->evidence);
    if (r->environment.map.pixel && r->environment.saturated_share > SKY_SATURATED)
        lamps_add_sky(&lamps);
    add_segments(&lamps);
    if (lamps.count > 0) {
        lamps_survey(&lamps, views, NULL, NULL);
        brighter = brighten(&lamps);
        lamps_fit_all(&lamps, brighter);
    }
    report(&lamps, brighter);
    lamps_hand_over(&lamps, brighter);
    lamps_release(&lamps);
}
