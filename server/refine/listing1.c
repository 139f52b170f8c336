/* listing1.c -- see listing1.h. */
#include "server/refine/listing1.h"

#include "common/mem.h"
#include "server/refine/emitter_decision.h"
#include "server/refine/params.h"

/* Fractions of the run: the decision about emitters; the end of the coarse levels, which get equal time. Each texel is
 * then its own for more than half of the run. */
#define DECISION_AT OPTIMISER_FALL_FROM
#define COARSE_PART 0.4 /* +25 %: -0.02 dB */
/* At the start a segment emits the part q^2 / (q^2 + NEUTRAL_BRIGHTNESS^2) of its observed radiance, q being its
 * brightness over the room's median. A segment that no photograph shows does not emit.
 * At this factor the shares are even: most walls are below it, lamps above. */
#define NEUTRAL_BRIGHTNESS 3.0f /* +25 %: no change */

_Static_assert(PASS_CHUNK_TEXELS >= EMITTER_DECISION_TEXELS, "the decision works in a pass's batches");

/* Progress of the method; in checkpoints. */
struct listing1_progress {
    int32_t level;
    int32_t decided; /* the emitters are fixed */
};

struct listing1 {
    struct optimiser *o; /* borrowed: its owner */
    struct params params;
    struct params_rates rates; /* at the start */
    struct gradient *gradient;
    struct gradient_log **log; /* [chunk_count] */
    struct listing1_progress progress;
    int coarse_levels;
    bool any_emits; /* setting emitters */
};

static int level_at(const struct listing1 *l, double fraction) {
    if (l->coarse_levels == 0 || fraction >= COARSE_PART)
        return 0;
    return l->coarse_levels - (int)(fraction / COARSE_PART * l->coarse_levels);
}

static struct params_rates rates_at(const struct listing1 *l, double fraction) {
    float fall = optimiser_rate_fall(fraction);
    return (struct params_rates){
        .base_color = fall * l->rates.base_color,
        .roughness = fall * l->rates.roughness,
        .specular = fall * l->rates.specular,
        .emission = fall * l->rates.emission,
    };
}

static void start_base_color(const struct inverse_uv *inverse, struct texture *base_color) {
    for (size_t i = 0; i < inverse->valid_count; i++) {
        float *value = base_color->texel[inverse->valid[i]];
        value[0] = value[1] = value[2] = NEUTRAL_BASE_COLOR;
    }
}

static float neutral_share(rgb observed, float median) {
    float q = rgb_mean(observed) / median;
    return q * q / (q * q + NEUTRAL_BRIGHTNESS * NEUTRAL_BRIGHTNESS);
}

static void start_neutral(const struct optimiser_input *in) {
    start_base_color(in->surface.inverse, &in->materials->base_color);
    for (size_t s = 0; s < in->surface.segments->count; s++) {
        rgb observed = in->evidence[s].radiance;
        in->materials->emission[s] = rgb_scale(observed, neutral_share(observed, in->views->median_radiance));
    }
}

static void fix_emitters(struct listing1 *l) {
    if (!l->any_emits)
        emission_fix(&l->o->emission, l->o->in.is_emitter);
    params_free_segments(&l->params);
}

static void decide_emitters(struct listing1 *l) {
    const struct optimiser_input *in = &l->o->in;
    if (!l->any_emits)
        emitter_decision_make(&(struct emitter_decision_input){in->surface, l->o->settings, l->o->pass.batch, in->pool},
                              in->evidence, in->is_emitter, in->materials);
    /* Emission by the segment's median may have exceeded the radiance of its dark parts, which base colour then
     * compensated: start it anew. */
    start_base_color(in->surface.inverse, &in->materials->base_color);
    params_refine(&l->params, l->progress.level);
    fix_emitters(l);
    for (size_t s = 0; s < in->surface.segments->count; s++)
        emission_set(&l->o->emission, s, in->materials->emission[s]);
    world_update_lights(in->world);
    l->progress.decided = 1;
}

static void walk_backwards(void *self, size_t chunk, struct observation_batch *b) {
    struct listing1 *l = self;
    gradient_log_clear(l->log[chunk]);
    if (b->observation_count > 0)
        path_batch_backward(b->paths, b->d_radiance, l->log[chunk]);
}

static void iterate(void *self, double fraction) {
    struct listing1 *l = self;
    struct optimiser *o = l->o;
    if (!l->progress.decided && fraction >= DECISION_AT)
        decide_emitters(l);
    /* Never back to a coarser level: extending a job lowers its fraction done. */
    if (l->progress.level > level_at(l, fraction)) {
        l->progress.level = level_at(l, fraction);
        params_refine(&l->params, l->progress.level);
    }
    pass_run(&o->pass, o->counters.iteration, walk_backwards, l);
    gradient_reduce(l->gradient, l->log, o->pass.chunk_count, o->in.pool);
    pass_d_emission(&o->pass, l->gradient->d_emission); /* instead of the full derivative (struct pass_emission) */
    struct params_rates rates = rates_at(l, fraction);
    params_step(&l->params, l->gradient, &rates, o->in.pool);
}

static void resumed(void *self) {
    struct listing1 *l = self;
    params_set_level(&l->params, l->progress.level);
    if (l->progress.decided)
        fix_emitters(l);
}

static void release(void *self) {
    struct listing1 *l = self;
    for (size_t c = 0; c < l->o->pass.chunk_count; c++)
        gradient_log_free(l->log[c]);
    mem_free(l->log);
    gradient_free(l->gradient);
    params_release(&l->params);
    mem_free(l);
}

static const struct optimiser_method method = {iterate, resumed, NULL, release};

struct optimiser *listing1_new(const struct optimiser_input *input) {
    const struct settings *set = input->pace->settings;
    const struct surface *surface = &input->surface;
    struct listing1 *l = mem_alloc(sizeof *l);
    start_neutral(input);
    struct optimiser *o = optimiser_new(input, true, &method, l);
    *l = (struct listing1){.o = o};
    l->any_emits = settings_is(set, "emitters", "any");
    l->coarse_levels = (int)settings_number(set, "coarse_levels");
    l->progress.level = l->coarse_levels;
    l->rates = (struct params_rates){
        .base_color = (float)settings_number(set, "base_color_rate"),
        .roughness = (float)settings_number(set, "roughness_rate"),
        .specular = (float)settings_number(set, "specular_rate"),
        .emission = (float)settings_number(set, "emission_rate"),
    };
    params_init(&l->params, input->materials, surface->inverse, surface->segments, &o->emission, l->coarse_levels);
    l->gradient = gradient_new(surface->atlas->width, surface->atlas->height, surface->segments->count);
    l->log = mem_array(o->pass.chunk_count, sizeof *l->log);
    for (size_t c = 0; c < o->pass.chunk_count; c++)
        l->log[c] = gradient_log_new(surface->segments->count);
    optimiser_add_state(o, "progress", &l->progress, sizeof l->progress);
    optimiser_add_state(o, "base_color.adam", l->params.base_color.record, adam_bytes(&l->params.base_color));
    optimiser_add_state(o, "roughness.adam", l->params.roughness.record, adam_bytes(&l->params.roughness));
    optimiser_add_state(o, "specular.adam", l->params.specular.record, adam_bytes(&l->params.specular));
    return o;
}
