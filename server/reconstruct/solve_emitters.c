/* solve_emitters.c -- see solve_emitters.h. */
#include "server/reconstruct/solve_emitters.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "common/ordered.h"
#include "server/light/decision/changing_light.h"
#include "server/light/decision/lambert_mean.h"
#include "server/light/decision/reflection.h"
#include "server/material/emission_pattern.h"
#include "server/reconstruct/inputs.h"
#include "server/scene/by_segment.h"

/* Part of a segment's surface whose light must have changed for it to be an emitter. */
#define EMITTER_CHANGES 0.08f
#define EVIDENCE_STRIDE 3 /* every third valid texel is used for the mean incident light, for time */

void solve_emitters_init(struct solve_emitters *s, struct reconstruction *r, const struct views *views,
                         const struct divide *divide) {
    *s = (struct solve_emitters){r, views, divide, mem_calloc(r->segments.count, sizeof *s->pattern_emitters)};
}

void solve_emitters_release(struct solve_emitters *s) { mem_free(s->pattern_emitters); }

/* Finds emission patterns, unless the emitters are those of the last time. */
static void find_patterns(struct solve_emitters *s) {
    struct reconstruction *r = s->r;
    if (memcmp(s->pattern_emitters, r->is_emitter, r->segments.count * sizeof *s->pattern_emitters) == 0)
        return;
    memcpy(s->pattern_emitters, r->is_emitter, r->segments.count * sizeof *s->pattern_emitters);
    const struct emission_pattern_input input = inputs_of_pattern(r, s->views);
    emission_pattern_find(&input, &r->materials, r->evidence);
}

void solve_emitters_light(struct solve_emitters *s) {
    struct reconstruction *r = s->r;
    find_patterns(s);
    for (size_t i = 0; i < r->segments.count; i++)
        r->materials.emission[i] = r->is_emitter[i] ? r->evidence[i].radiance : rgb_gray(0.0f);
    world_update_lights(&r->world);
}

struct lambert_sums {
    const struct solve_emitters *emitters;
    struct lambert_mean *sum; /* [segment_count] */
};

static uint32_t evidence_texel(const struct reconstruction *r, size_t index) {
    return r->inverse.valid[index * EVIDENCE_STRIDE];
}

/* Lambert radiance of a texel that is observed, or of any of a segment that was observed only in mixed pixels, such as
 * a lamp thinner than a pixel; else NAN. */
static void find_lambert(void *user, size_t index, void *result) {
    const struct lambert_sums *sums = user;
    const struct reconstruction *r = sums->emitters->r;
    uint32_t texel = evidence_texel(r, index);
    rgb *lambert = result;
    bool is_seen = r->fused.count[texel] > 0.0f || r->evidence[reconstruction_segment(r, texel)].only_mixed;
    if (!is_seen || !divide_lambert(sums->emitters->divide, texel, lambert))
        *lambert = rgb_gray(NAN);
}

static void add_lambert(void *user, size_t index, const void *result) {
    const struct lambert_sums *sums = user;
    const struct reconstruction *r = sums->emitters->r;
    uint32_t texel = evidence_texel(r, index);
    size_t segment = reconstruction_segment(r, texel);
    const rgb *lambert = result;
    if (!isnan(lambert->r))
        lambert_mean_add(&sums->sum[segment], &r->evidence[segment], fused_radiance(&r->fused, texel), *lambert);
}

/* Fills evidence.lambert with means over the texels. */
static void average_lambert(const struct solve_emitters *s) {
    const struct reconstruction *r = s->r;
    struct lambert_sums sums = {s, mem_calloc(r->segments.count, sizeof *sums.sum)};
    ordered_for(r->pool, (r->inverse.valid_count + EVIDENCE_STRIDE - 1) / EVIDENCE_STRIDE, sizeof(rgb), find_lambert,
                add_lambert, &sums);
    for (size_t i = 0; i < r->segments.count; i++) {
        struct emitter_evidence *e = &r->evidence[i];
        rgb lambert;
        if (!lambert_mean_of(&sums.sum[i], &lambert))
            lambert = e->radiance; /* without evidence a segment counts as a reflector */
        evidence_set_lambert(e, lambert);
    }
    mem_free(sums.sum);
}

struct decision {
    const struct solve_emitters *emitters;
    struct texels_by_segment texels;
};

static void decide(void *user, size_t segment, int thread) {
    const struct decision *d = user;
    struct reconstruction *r = d->emitters->r;
    struct emitter_evidence *e = &r->evidence[segment];
    size_t first = d->texels.first[segment], count = d->texels.first[segment + 1] - first;
    reflection_find(r, d->emitters->divide, (uint32_t)segment, d->texels.texel + first, count, thread);
    e->changing_share = changing_light(d->emitters->divide, d->texels.texel + first, count, thread);
    bool emits = e->is_hidden || e->changing_share > EMITTER_CHANGES || reflection_is_unlikely(e);
    r->is_emitter[segment] = settings_emitter(r->settings, (uint32_t)segment, emits);
}

void solve_emitters_decide(struct solve_emitters *s) {
    struct reconstruction *r = s->r;
    struct decision decision = {.emitters = s};
    average_lambert(s);
    by_segment_sort(&decision.texels, &r->segments, &r->inverse);
    parallel_for(r->pool, r->segments.count, decide, &decision);
    by_segment_release(&decision.texels);
}

void solve_emitters_finish(struct solve_emitters *s) {
    struct reconstruction *r = s->r;
    struct emitter_fit *emitter = mem_array(r->segments.count, sizeof *emitter);
    find_patterns(s);
    const struct emission_pattern_input input = inputs_of_pattern(r, s->views);
    emission_pattern_separate(&input, &r->materials, r->evidence, emitter);
    for (size_t i = 0; i < r->segments.count; i++)
        r->materials.emission[i] = emitter[i].radiance;
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        uint32_t texel = r->inverse.valid[i], segment = reconstruction_segment(r, texel);
        float *color = r->materials.base_color.texel[texel];
        for (int c = 0; c < 3 && r->is_emitter[segment]; c++)
            color[c] = emitter[segment].base_color;
    }
    mem_free(emitter);
    world_update_lights(&r->world);
}
