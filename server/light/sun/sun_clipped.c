/* sun_clipped.c -- see sun_clipped.h. */
#include "server/light/sun/sun_clipped.h"

#include <math.h>
#include <stdlib.h>

#include "common/mem.h"
#include "common/spaced.h"
#include "server/light/light_point.h"
#include "server/light/light_priors.h"
#include "server/light/sun/sun_directions.h"
#include "server/render/bsdf.h"

#define PLACES 16384     /* evenly spread over all that photographs show */
#define ODDS 20.0        /* of saturation in the sun over that in its shade */
#define EDGES 2.0f       /* of a patch, in those of the joint fit: some .6 m */
#define PLACES_ALIKE 6.0 /* independent draws that a patch's places are worth, at most */
#define RADIUS_DEGREES 0.27f
#define NEAR_DEGREES 7.0 /* so near to the right direction a wrong one is likely, too */

struct clipped_place {
    int64_t object; /* parts that shine are segments of their own (split.h) */
    uint32_t patch;
    bool is_clipped;
    struct surface_point at;
};

/* Places first to end, of which some saturate and some do not. */
struct clipped_patch {
    size_t first, end, clipped;
};

struct clipped_search {
    const struct reconstruction *r;
    size_t place_count, patch_count;
    struct clipped_place *place; /* [place_count] by object and patch; owned, as all below */
    struct clipped_patch *patch; /* [patch_count] */
    double *log_factorial;       /* [places of the largest patch + 1] */
    struct sun_candidate *candidate;
};

/* --- places ------------------------------------------------------------------------------------------------ */

static int by_patch(const void *a, const void *b) {
    const struct clipped_place *first = a, *second = b;
    if (first->object != second->object)
        return first->object < second->object ? -1 : 1;
    if (first->patch != second->patch)
        return first->patch < second->patch ? -1 : 1;
    return (first->at.triangle > second->at.triangle) - (first->at.triangle < second->at.triangle);
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
        p->is_clipped = r->fused.is_bound[texel];
        s->place_count++;
    }
    qsort(s->place, s->place_count, sizeof *s->place, by_patch);
}

/* Those of which some places saturate and some do not. */
static void find_patches(struct clipped_search *s) {
    size_t largest = 0;
    s->patch = mem_array(s->place_count + 1, sizeof *s->patch);
    for (size_t first = 0, end; first < s->place_count; first = end) {
        struct clipped_patch patch = {.first = first};
        for (end = first; end < s->place_count && s->place[end].object == s->place[first].object &&
                          s->place[end].patch == s->place[first].patch;
             end++)
            patch.clipped += s->place[end].is_clipped;
        patch.end = end;
        if (patch.clipped == 0 || patch.clipped == end - first)
            continue;
        s->patch[s->patch_count++] = patch;
        largest = end - first > largest ? end - first : largest;
    }
    s->log_factorial = mem_array(largest + 1, sizeof *s->log_factorial);
    s->log_factorial[0] = 0.0;
    for (size_t i = 1; i <= largest; i++)
        s->log_factorial[i] = s->log_factorial[i - 1] + log((double)i);
}

/* --- evidence ---------------------------------------------------------------------------------------------- */

static double log_choose(const struct clipped_search *s, size_t n, size_t k) {
    return s->log_factorial[n] - s->log_factorial[k] - s->log_factorial[n - k];
}

static double log_add(double a, double b) {
    double most = fmax(a, b);
    return most + log(exp(a - most) + exp(b - most));
}

/* Of `all` places `clipped` saturate, `lit` see the sun, and `both` do both: log(P(both) with it / P(both) without). */
static double evidence_of(const struct clipped_search *s, size_t all, size_t clipped, size_t lit, size_t both) {
    size_t first = clipped + lit > all ? clipped + lit - all : 0, last = clipped < lit ? clipped : lit;
    double of_all = log_choose(s, all, lit), sum = -INFINITY; /* logarithm of the mean of ODDS^k without a sun */
    for (size_t k = first; k <= last; k++)
        sum = log_add(sum, log_choose(s, clipped, k) + log_choose(s, all - clipped, lit - k) - of_all +
                               (double)k * log(ODDS));
    return (double)both * log(ODDS) - sum;
}

static double score_of(void *user, vec3 direction) {
    const struct clipped_search *s = user;
    const struct sun sun = {.direction = direction};
    double sum = 0.0;
    for (size_t i = 0; i < s->patch_count; i++) {
        const struct clipped_patch *patch = &s->patch[i];
        size_t all = patch->end - patch->first, lit = 0, both = 0;
        for (size_t k = patch->first; k < patch->end; k++) {
            bool is_lit = sun_visibility(&sun, s->r->world.accel, &s->place[k].at, 1) > 0.0f;
            lit += is_lit;
            both += is_lit && s->place[k].is_clipped;
        }
        sum += fmin(1.0, PLACES_ALIKE / (double)all) * evidence_of(s, all, patch->clipped, lit, both);
    }
    return sum;
}

static void score_candidate(void *user, size_t index, int thread) {
    (void)thread;
    struct clipped_search *s = user;
    s->candidate[index].score = score_of(s, s->candidate[index].direction);
}

/* --- the whole --------------------------------------------------------------------------------------------- */

/* The likeliest direction that no photograph measures, and by how much it exceeds all that are no neighbours of it;
 * *count: directions that none measures. */
static struct sun_candidate find_likeliest(struct clipped_search *s, double *beyond, size_t *count) {
    const struct environment *e = &s->r->environment;
    struct sun_candidate best = {.score = 0.0};
    double rival = 0.0;
    size_t all = sun_directions_spread(e, NULL, &s->candidate);
    parallel_for(s->r->pool, s->patch_count > 0 ? all : 0, score_candidate, s);
    for (size_t i = 0; i < all; i++) {
        bool may_be = !e->map.pixel || !environment_is_measured(e, s->candidate[i].direction);
        *count += may_be;
        if (may_be && s->candidate[i].score > best.score)
            best = s->candidate[i];
    }
    for (size_t i = 0; i < all; i++) {
        bool is_near = (double)vec3_dot(s->candidate[i].direction, best.direction) > cos(NEAR_DEGREES * PI / 180.0);
        rival = is_near ? rival : fmax(rival, s->candidate[i].score);
    }
    *beyond = best.score - rival;
    return best;
}

void sun_clipped_find(struct reconstruction *r) {
    struct clipped_search s = {.r = r};
    double beyond;
    size_t count = 0;
    find_places(&s);
    find_patches(&s);
    struct sun_candidate best = find_likeliest(&s, &beyond, &count);
    if (best.score > log(SURE * (double)(count + 1)) && beyond > log(SURE)) {
        sun_directions_walk(&best, 1.5, 0.1, score_of, &s);
        r->sun = (struct sun){.is_there = true, .is_clipped = true, .direction = best.direction};
        r->sun.radius_rad = RADIUS_DEGREES * BSDF_PI / 180.0f;
    }
    mem_free(s.candidate);
    mem_free(s.log_factorial);
    mem_free(s.patch);
    mem_free(s.place);
}
