/* sun_clipped.c -- see sun_clipped.h. */
#include "server/light/sun/sun_clipped.h"

#include <math.h>
#include <stdlib.h>

#include "common/mem.h"
#include "common/spaced.h"
#include "server/light/light_point.h"
#include "server/light/light_priors.h"
#include "server/light/sun/sun_directions.h"
#include "server/light/sun/symmetric_sum.h"
#include "server/render/bsdf.h"

#define PLACES 16384      /* evenly spread over all that photographs show */
#define PLACES_A_PATCH 64 /* of these, at most */
#define ODDS 20.0         /* of saturation in the sun over that in its shade */
#define EDGES 2.0f        /* of a patch, in those of the joint fit: some .6 m */
#define PLACES_ALIKE 6.0  /* independent draws that a patch's places are worth, at most */
/* Power of its light by which the odds of a place may rise: at most as the logistic distribution does that is nearest
 * to a normal one (1.7 deviations: Haley 1952) of albedos, if there were no light but that of the sky. */
#define STEEPEST (1.7 / ALBEDO_POINT)
#define POWER_STEPS 16 /* halvings of the interval in which it is sought, by the golden ratio */

struct clipped_place {
    int64_t object; /* parts that shine are segments of their own (split.h) */
    uint32_t patch, texel;
    bool is_clipped;
    double light; /* the logarithm of what all directions that may saturate bring, and as much again on average */
    struct surface_point at;
};

/* Places first to end, of which some saturate and some do not. */
struct clipped_patch {
    size_t first, end, clipped;
    double log_sum; /* symmetric_sum_log of its places without a sun */
};

struct clipped_search {
    const struct reconstruction *r;
    size_t place_count, patch_count;
    struct clipped_place *place; /* [place_count] by object and patch; owned, as all below */
    struct clipped_patch *patch; /* [patch_count] */
    size_t candidate_count;
    struct sun_candidate *candidate;
    bool *may_be; /* [candidate_count] no photograph measures the direction */
    double power; /* of its light, by which the odds rise that a place saturates */
};

/* --- places ------------------------------------------------------------------------------------------------ */

static int by_patch(const void *a, const void *b) {
    const struct clipped_place *first = a, *second = b;
    if (first->object != second->object)
        return first->object < second->object ? -1 : 1;
    if (first->patch != second->patch)
        return first->patch < second->patch ? -1 : 1;
    return (first->texel > second->texel) - (first->texel < second->texel);
}

static void find_places(struct clipped_search *s) {
    const struct reconstruction *r = s->r;
    const struct mesh *mesh = &r->scene->mesh;
    size_t seen = 0;
    vec3 least, most;
    mesh_bounds(mesh, &least, &most);
    for (size_t i = 0; i < r->inverse.valid_count; i++)
        seen += r->fused.count[r->inverse.valid[i]] > 0.0f;
    struct spacing spacing = {.all = seen, .wanted = seen < PLACES ? seen : PLACES};
    s->place = mem_array(spacing.wanted + 1, sizeof *s->place);
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        uint32_t texel = r->inverse.valid[i];
        struct clipped_place *p = &s->place[s->place_count];
        if (!(r->fused.count[texel] > 0.0f) || !spacing_takes(&spacing) ||
            !surface_at_texel(mesh, &r->atlas, &r->inverse, texel, &p->at))
            continue;
        p->object = r->segments.id[reconstruction_segment(r, texel)];
        p->patch = light_patch(&p->at, least, EDGES * light_patch_edge(mesh));
        p->texel = texel;
        p->is_clipped = r->fused.is_bound[texel];
        s->place_count++;
    }
    qsort(s->place, s->place_count, sizeof *s->place, by_patch);
}

static bool is_one_patch(const struct clipped_place *a, const struct clipped_place *b) {
    return a->object == b->object && a->patch == b->patch;
}

/* Patches of which some places saturate and some do not; only their places are kept. */
static void find_patches(struct clipped_search *s) {
    size_t kept = 0;
    s->patch = mem_array(s->place_count + 1, sizeof *s->patch);
    for (size_t first = 0, end; first < s->place_count; first = end) {
        struct clipped_patch patch = {.first = kept};
        for (end = first; end < s->place_count && is_one_patch(&s->place[end], &s->place[first]);)
            end++;
        size_t all = end - first, wanted = all < PLACES_A_PATCH ? all : PLACES_A_PATCH;
        for (size_t k = 0; k < wanted; k++) {
            s->place[kept + k] = s->place[first + spaced(k, all, wanted)];
            patch.clipped += s->place[kept + k].is_clipped;
        }
        if (patch.clipped == 0 || patch.clipped == wanted)
            continue;
        patch.end = kept += wanted;
        s->patch[s->patch_count++] = patch;
    }
    s->place_count = kept;
}

/* --- the light of the sky ---------------------------------------------------------------------------------- */

static void find_directions(struct clipped_search *s) {
    const struct environment *e = &s->r->environment;
    s->candidate_count = sun_directions_spread(e, NULL, &s->candidate);
    s->may_be = mem_array(s->candidate_count + 1, sizeof *s->may_be);
    for (size_t i = 0; i < s->candidate_count; i++)
        s->may_be[i] = !e->map.pixel || !environment_is_measured(e, s->candidate[i].direction);
}

static void find_light(void *user, size_t index, int thread) {
    (void)thread;
    struct clipped_search *s = user;
    struct clipped_place *p = &s->place[index];
    p->light = 0.0;
    for (size_t i = 0; i < s->candidate_count; i++) {
        const struct sun sun = {.direction = s->candidate[i].direction};
        if (s->may_be[i])
            p->light += (double)(fmaxf(vec3_dot(sun.direction, p->at.shading), 0.0f) *
                                 sun_visibility(&sun, s->r->world.accel, &p->at, 1));
    }
}

/* Other light is taken for as much as that of the sky is on average. */
static void find_all_light(struct clipped_search *s) {
    double mean = 0.0;
    parallel_for(s->r->pool, s->place_count, find_light, s);
    for (size_t i = 0; i < s->place_count; i++)
        mean += s->place[i].light / (double)s->place_count;
    for (size_t i = 0; i < s->place_count; i++)
        s->place[i].light = mean > 0.0 ? log(1.0 + s->place[i].light / mean) : 0.0;
}

/* --- evidence ---------------------------------------------------------------------------------------------- */

/* Scratch for a patch. */
struct clipped_scratch {
    double weight[PLACES_A_PATCH], chance[PLACES_A_PATCH + 1];
};

static double patch_share(const struct clipped_patch *patch) {
    return fmin(1.0, PLACES_ALIKE / (double)(patch->end - patch->first));
}

/* Log likelihood of all patches without a sun; their log_sum. */
static double settle(struct clipped_search *s, double power) {
    struct clipped_scratch scratch;
    double sum = 0.0;
    s->power = power;
    for (size_t i = 0; i < s->patch_count; i++) {
        struct clipped_patch *patch = &s->patch[i];
        size_t all = patch->end - patch->first;
        double own = 0.0;
        for (size_t k = 0; k < all; k++) {
            double log_odds = power * s->place[patch->first + k].light;
            scratch.weight[k] = exp(log_odds);
            own += s->place[patch->first + k].is_clipped ? log_odds : 0.0;
        }
        patch->log_sum = symmetric_sum_log(scratch.weight, all, patch->clipped, scratch.chance);
        sum += patch_share(patch) * (own - patch->log_sum);
    }
    return sum;
}

/* The power by which it is likeliest that those places saturate that do; the likelihood is concave in it. */
static void find_power(struct clipped_search *s) {
    const double ratio = 0.5 * (sqrt(5.0) - 1.0);
    double low = 0.0, high = STEEPEST, a = high - ratio * high, b = ratio * high, of_a = settle(s, a),
           of_b = settle(s, b);
    for (int i = 0; i < POWER_STEPS; i++) {
        if (of_a > of_b) {
            high = b, b = a, of_b = of_a;
            of_a = settle(s, a = high - ratio * (high - low));
        } else {
            low = a, a = b, of_a = of_b;
            of_b = settle(s, b = low + ratio * (high - low));
        }
    }
    settle(s, 0.5 * (low + high));
}

/* How much likelier a patch is with a sun of that direction, a logarithm. */
static double patch_evidence(const struct clipped_search *s, const struct clipped_patch *patch, const struct sun *sun,
                             struct clipped_scratch *scratch) {
    size_t all = patch->end - patch->first, lit = 0, both = 0;
    for (size_t k = 0; k < all; k++) {
        const struct clipped_place *p = &s->place[patch->first + k];
        bool is_lit = sun_visibility(sun, s->r->world.accel, &p->at, 1) > 0.0f;
        scratch->weight[k] = exp(s->power * p->light) * (is_lit ? ODDS : 1.0);
        lit += is_lit;
        both += is_lit && p->is_clipped;
    }
    if (lit == 0 || lit == all)
        return 0.0;
    double log_sum = symmetric_sum_log(scratch->weight, all, patch->clipped, scratch->chance);
    return patch_share(patch) * ((double)both * log(ODDS) - log_sum + patch->log_sum);
}

static double score_of(void *user, vec3 direction) {
    const struct clipped_search *s = user;
    const struct sun sun = {.direction = direction};
    struct clipped_scratch scratch;
    double sum = 0.0;
    for (size_t i = 0; i < s->patch_count; i++)
        sum += patch_evidence(s, &s->patch[i], &sun, &scratch);
    return sum;
}

static void score_candidate(void *user, size_t index, int thread) {
    (void)thread;
    struct clipped_search *s = user;
    s->candidate[index].score = score_of(s, s->candidate[index].direction);
}

/* --- the whole --------------------------------------------------------------------------------------------- */

/* The likeliest direction that no photograph measures; *count: of those, how many these places could tell. */
static struct sun_candidate find_likeliest(struct clipped_search *s, size_t *count) {
    struct sun_candidate best = {.score = 0.0};
    parallel_for(s->r->pool, s->candidate_count, score_candidate, s);
    for (size_t i = 0; i < s->candidate_count; i++) {
        *count += s->may_be[i] && s->candidate[i].score != 0.0;
        if (s->may_be[i] && s->candidate[i].score > best.score)
            best = s->candidate[i];
    }
    return best;
}

void sun_clipped_find(struct reconstruction *r) {
    struct clipped_search s = {.r = r};
    size_t count = 0;
    find_places(&s);
    find_patches(&s);
    find_directions(&s);
    find_all_light(&s);
    find_power(&s);
    struct sun_candidate best = find_likeliest(&s, &count);
    if (best.score > log(SURE * (double)(count + 1))) {
        sun_directions_walk(&best, 1.5, 0.1, score_of, &s);
        r->sun = (struct sun){.is_there = true, .is_clipped = true, .direction = best.direction};
        r->sun.radius_rad = SUN_RADIUS_RAD;
    }
    mem_free(s.may_be);
    mem_free(s.candidate);
    mem_free(s.patch);
    mem_free(s.place);
}
