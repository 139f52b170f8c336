/* listing1.c -- see listing1.h.
 *
 * Texels of an iteration are cut into chunks; a chunk owns a gradient log and a loss sum, both
 * indexed by the chunk and reduced in chunk order, so threads and timing leave no trace. */
#include "server/reconstruct/listing1.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "common/mem.h"
#include "common/rng.h"
#include "server/reconstruct/choose.h"
#include "server/reconstruct/emitters.h"
#include "server/reconstruct/look.h"
#include "server/reconstruct/loss.h"
#include "server/reconstruct/params.h"
#include "server/render/path.h"

#define CHUNK_TEXELS EMITTERS_TEXELS
#define CURVE_POINTS 256

/* Parts of the run, as fractions of it. The levels of the coarse part get equal time; the decision
 * about emitters falls into the first of them. */
#define DECISION_AT 0.08
#define COARSE_PART 0.4
/* The neutral start of emission. Of what the photographs show of a segment the part
 * q^2 / (q^2 + NEUTRAL_BRIGHTNESS^2) is its own light, q being how many times brighter it is than
 * the median of the room; the rest is reflected. A segment that no photograph shows does not emit. */
#define NEUTRAL_BRIGHTNESS 3.0f
#define NEUTRAL_BASE_COLOR 0.5f
/* From the decision on step sizes fall as 1 / (1 + RATE_FALL t), t in [0, 1]. */
#define RATE_FALL 15.0
/* A segment whose emission explained this share at the decision is listed in the report. */
#define REPORTED_SHARE 0.05f

/* What a checkpoint holds beside the parameters. */
struct counters {
    uint64_t iteration;
    double elapsed_sec;
    uint64_t path_count, ray_count, dropped_count;
    int32_t level;
    int32_t decided; /* the emitters are fixed */
    double curve_sum[CURVE_POINTS];
    double curve_count[CURVE_POINTS];
    double planned; /* iterations or seconds that the curve is drawn over */
};

struct refine {
    struct reconstruction *r;
    const struct views *views;
    const struct reconstruct_hooks *hooks;
    struct params params;
    struct chooser chooser;
    struct counters counters;
    struct path_settings path;
    struct gradient *gradient;
    size_t chunk_count;
    struct gradient_log **log; /* [chunk_count] */
    double *chunk_loss;        /* [chunk_count] sum of loss estimates */
    size_t *chunk_looks;       /* [chunk_count] */
    struct seen *seen;         /* [chunk_count][look_capacity] what each look found, in order */
    size_t look_capacity;      /* looks a chunk */
    struct look_batch *batch;  /* [threads] */
    uint64_t iteration_limit;  /* 0: by time */
    double time_limit_sec;
    int coarse_levels;
    bool one_estimate, by_pixels, any_emits; /* settings estimates, choose and emitters */
    bool solved;               /* it starts from solved materials and corrects what is smooth in them */
};

/* What a look found. d_emission is the derivative of its loss by the emission of the segment that
 * it looks at. Only what is seen of a segment moves its emission. What it sheds on other surfaces
 * is left out: there emission and base colour can stand in for each other (the bias that this
 * accepts: none at the optimum, where both derivatives are 0), and while base colours are still
 * too dark it would drive the lamps up. */
struct seen {
    uint32_t segment, texel;
    rgb d_emission;
    struct loss_match match; /* what a step from the solved start goes by */
    float trust;
};

/* What one look found, for the steps that gather by look and not by path. */
static void note_look(const struct refine *f, const struct look_batch *b, size_t k, struct seen *seen) {
    const struct look *look = &b->look[k];
    size_t first = k * (size_t)b->samples;
    *seen = (struct seen){.segment = look->segment, .texel = look->texel, .trust = look->trust};
    seen->match = loss_match_pair(b->reference + first, b->radiance + first, b->samples,
                                  fused_radiance(&f->r->fused, look->texel), f->views->median_radiance);
    for (int i = 0; i < b->samples; i++) {
        rgb *d = &b->d_radiance[first + (size_t)i];
        *d = rgb_scale(*d, look->trust);
        seen->d_emission = rgb_add(seen->d_emission, *d);
    }
}

static void run_chunk(void *user, size_t chunk, int thread) {
    struct refine *f = user;
    struct look_batch *b = &f->batch[thread];
    gradient_log_clear(f->log[chunk]);
    look_batch_clear(b);
    size_t end = (chunk + 1) * CHUNK_TEXELS;
    for (size_t i = chunk * CHUNK_TEXELS; i < end && i < f->chooser.stratum_count; i++) {
        size_t item = chooser_item(&f->chooser, f->counters.iteration, i);
        if (f->by_pixels)
            look_add_pixels(b, i, f->counters.iteration);
        else if (item != CHOOSE_NONE)
            look_add(b, f->r->inverse.valid[item], f->counters.iteration);
    }
    look_trace(b);
    double loss = 0.0;
    for (size_t k = 0; k < b->look_count; k++) {
        size_t first = k * (size_t)b->samples;
        loss += (double)loss_pair(b->look[k].photograph, b->reference + first, b->radiance + first,
                                  b->samples, f->one_estimate, f->views->median_radiance,
                                  b->d_radiance + first);
        note_look(f, b, k, &f->seen[chunk * b->look_capacity + k]);
    }
    f->chunk_loss[chunk] = loss;
    f->chunk_looks[chunk] = b->look_count;
    /* From a solved start only what is seen moves: no path is walked backwards. */
    if (b->look_count > 0 && !f->solved)
        path_batch_backward(b->paths, &f->r->world, b->d_radiance, f->log[chunk]);
}

static double now_sec(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* How much of the run is done, in [0, 1]. */
static double fraction_done(const struct refine *f) {
    double fraction = f->iteration_limit
                          ? (double)f->counters.iteration / (double)f->iteration_limit
                          : f->counters.elapsed_sec / f->time_limit_sec;
    return fraction < 1.0 ? fraction : 1.0;
}

static int level_at(const struct refine *f, double fraction) {
    if (f->solved || f->coarse_levels == 0)
        return f->coarse_levels;
    if (fraction >= COARSE_PART)
        return 0;
    return f->coarse_levels - (int)(fraction / COARSE_PART * f->coarse_levels);
}

static struct params_rates rates_at(const struct refine *f, double fraction) {
    const struct settings *set = f->r->settings;
    double since = fmax(0.0, (fraction - DECISION_AT) / (1.0 - DECISION_AT));
    float fall = (float)(1.0 / (1.0 + RATE_FALL * since));
    return (struct params_rates){
        .base_color = fall * (float)settings_number(set, "base_color_rate"),
        .roughness = f->solved ? 0.0f : fall * (float)settings_number(set, "roughness_rate"),
        .specular = f->solved ? 0.0f : fall * (float)settings_number(set, "specular_rate"),
        .emission = fall * (float)settings_number(set, "emission_rate"),
        .skip_base_color = f->solved,
    };
}

static void start_base_color(struct refine *f) {
    struct texture *texture = &f->r->materials.base_color;
    for (size_t i = 0; i < f->r->inverse.valid_count; i++) {
        float *value = texture->texel[f->r->inverse.valid[i]];
        value[0] = value[1] = value[2] = NEUTRAL_BASE_COLOR;
    }
}

static void fix_emitters(struct refine *f) {
    if (f->any_emits)
        params_free_emission(&f->params);
    else
        params_fix_emitters(&f->params, f->r->is_emitter);
}

static void decide_emitters(struct refine *f) {
    struct reconstruction *r = f->r;
    if (!f->any_emits)
        emitters_decide(r, f->views, f->batch, f->r->evidence);
    /* A part of a segment's median light may have been more than all of its dark parts': what base
     * colour did about that is worth nothing. */
    start_base_color(f);
    params_refine(&f->params, f->counters.level);
    fix_emitters(f);
    for (size_t s = 0; s < r->segments.count; s++)
        params_set_emission(&f->params, s, r->materials.emission[s]);
    world_update_lights(&r->world);
    f->counters.decided = 1;
}

/* Replaces the derivative by emission with that of what is seen; see struct seen. */
static void reduce_seen_emission(struct refine *f) {
    struct gradient *g = f->gradient;
    memset(g->d_emission, 0, g->segment_count * sizeof *g->d_emission);
    for (size_t c = 0; c < f->chunk_count; c++) {
        const struct seen *seen = &f->seen[c * f->look_capacity];
        for (size_t i = 0; i < f->chunk_looks[c]; i++) {
            double *d = g->d_emission[seen[i].segment];
            d[0] += (double)seen[i].d_emission.r;
            d[1] += (double)seen[i].d_emission.g;
            d[2] += (double)seen[i].d_emission.b;
        }
    }
}

/* Scales the blocks that were looked at towards what the photographs show of them. */
static void match_blocks(struct refine *f) {
    for (size_t c = 0; c < f->chunk_count; c++) {
        const struct seen *seen = &f->seen[c * f->look_capacity];
        for (size_t i = 0; i < f->chunk_looks[c]; i++)
            params_match(&f->params, seen[i].texel, &seen[i].match, seen[i].trust * seen[i].match.trust);
    }
}

/* One pass of Listing 1; returns the mean loss of its looks. */
static double iterate(struct refine *f, double fraction) {
    /* First, since after a resume the lights are not yet those of the materials. */
    world_update_lights(&f->r->world);
    if (!f->counters.decided && fraction >= DECISION_AT)
        decide_emitters(f);
    /* Never back to a coarser one: an extended job has a smaller part of its run behind it. */
    if (f->counters.level > level_at(f, fraction)) {
        f->counters.level = level_at(f, fraction);
        params_refine(&f->params, f->counters.level);
    }
    parallel_for(f->r->pool, f->chunk_count, run_chunk, f);
    gradient_reduce(f->gradient, f->log, f->chunk_count, f->r->pool);
    reduce_seen_emission(f);
    struct params_rates rates = rates_at(f, fraction);
    if (f->solved)
        match_blocks(f);
    params_step(&f->params, f->gradient, &rates, f->r->pool);
    double loss = 0.0;
    size_t looks = 0;
    for (size_t c = 0; c < f->chunk_count; c++) {
        loss += f->chunk_loss[c];
        looks += f->chunk_looks[c];
    }
    f->counters.path_count += looks * (size_t)f->batch[0].samples;
    double mean = looks ? loss / (double)looks : 0.0;
    size_t bin = (size_t)(fraction * (CURVE_POINTS - 1));
    f->counters.curve_sum[bin] += mean;
    f->counters.curve_count[bin] += 1.0;
    f->counters.iteration++;
    return mean;
}

/* The state that a checkpoint holds; array[] needs room for all. */
static size_t state_arrays(struct refine *f, struct state_array *array) {
    struct params *p = &f->params;
    struct materials *m = p->materials;
    size_t segments = m->segment_count;
    size_t texels = (size_t)m->base_color.width * m->base_color.height;
    size_t n = 0;
#define ADD(name_, data_, bytes_) array[n++] = (struct state_array){name_, data_, bytes_}
#define ADD_ADAM(name_, adam_) ADD(name_ ".adam", (adam_)->record, adam_bytes(adam_))
    ADD("counters", &f->counters, sizeof f->counters);
    ADD("base_color", m->base_color.texel, texels * sizeof *m->base_color.texel);
    ADD("roughness", m->roughness, segments * sizeof *m->roughness);
    ADD("specular", m->specular, segments * sizeof *m->specular);
    ADD("emission", m->emission, segments * sizeof *m->emission);
    ADD("emission.log", p->log_emission, segments * sizeof *p->log_emission);
    ADD("emission.evidence", f->r->evidence, segments * sizeof *f->r->evidence);
    ADD("emission.is_emitter", f->r->is_emitter, segments * sizeof *f->r->is_emitter);
    ADD_ADAM("base_color", &p->base_color);
    ADD_ADAM("roughness", &p->roughness);
    ADD_ADAM("specular", &p->specular);
    ADD_ADAM("emission", &p->emission);
#undef ADD_ADAM
#undef ADD
    return n;
}

static enum status save(struct refine *f, struct error *err) {
    struct state_array array[24];
    size_t count = state_arrays(f, array);
    return f->hooks->checkpoint_save(f->hooks->user, (long)f->counters.iteration, array, count, err);
}

/* The run was extended: what the curve has lies in a smaller part of it. */
static void redraw_curve(struct refine *f) {
    struct counters *c = &f->counters;
    double planned = f->iteration_limit ? (double)f->iteration_limit : f->time_limit_sec;
    for (size_t i = 0; planned > c->planned && i < CURVE_POINTS; i++) {
        size_t bin = (size_t)((double)i * c->planned / planned);
        double sum = c->curve_sum[i], count = c->curve_count[i];
        c->curve_sum[i] = c->curve_count[i] = 0.0;
        c->curve_sum[bin] += sum;
        c->curve_count[bin] += count;
    }
    c->planned = planned;
}

enum status listing1_load(struct refine *f, bool *found, struct error *err) {
    struct state_array array[24];
    size_t count = state_arrays(f, array);
    enum status status = f->hooks->checkpoint_load(f->hooks->user, array, count, found, err);
    redraw_curve(f);
    if (status != STATUS_OK || !*found)
        return status;
    char line[128];
    snprintf(line, sizeof line, "resumed at iteration %llu", (unsigned long long)f->counters.iteration);
    f->hooks->log(f->hooks->user, line);
    params_set_level(&f->params, f->counters.level);
    if (f->counters.decided)
        fix_emitters(f);
    return STATUS_OK;
}

enum status listing1_start_solved(struct refine *f, double seconds, struct error *err) {
    struct reconstruction *r = f->r;
    params_fix_emitters(&f->params, r->is_emitter);
    for (size_t s = 0; s < r->segments.count; s++)
        params_set_emission(&f->params, s, r->materials.emission[s]);
    f->counters.decided = 1;
    f->counters.elapsed_sec = seconds;
    return save(f, err);
}

/* For the daemon's figures: all rays of this attempt so far. */
static void tell_rays(const struct refine *f) {
    uint64_t rays, dropped, sum = 0;
    for (int t = 0; t < parallel_thread_count(f->r->pool); t++) {
        path_batch_counts(f->batch[t].paths, &rays, &dropped);
        sum += rays;
    }
    f->hooks->metric(f->hooks->user, "rays", (long)f->counters.iteration, (double)sum);
}

/* How far it is, after an iteration of this loss. */
static void tell(const struct refine *f, double loss) {
    const struct reconstruct_hooks *hooks = f->hooks;
    double fraction = fraction_done(f);
    double left = fraction > 0.0 ? f->counters.elapsed_sec * (1.0 / fraction - 1.0) : -1.0;
    hooks->progress(hooks->user, "refine", fraction, 1.0, left);
    hooks->metric(hooks->user, "loss", (long)f->counters.iteration, loss);
    tell_rays(f);
}

static enum status loop(struct refine *f, struct error *err) {
    const struct reconstruct_hooks *hooks = f->hooks;
    double told = 0.0;
    for (;;) {
        double begin = now_sec(), fraction = fraction_done(f);
        if (fraction >= 1.0)
            break;
        double loss = iterate(f, fraction);
        double end = now_sec();
        f->counters.elapsed_sec += end - begin;
        if (end - told > 1.0 || fraction_done(f) >= 1.0) {
            told = end;
            tell(f, loss);
        }
        bool stop = hooks->stop_requested(hooks->user);
        if (stop || hooks->checkpoint_due(hooks->user)) {
            enum status status = save(f, err);
            if (status != STATUS_OK)
                return status;
        }
        if (stop)
            return error_set(err, STATUS_CANCELLED, "stopped at iteration %llu",
                             (unsigned long long)f->counters.iteration);
        if (hooks->preview_due(hooks->user)) {
            enum status status = hooks->preview(hooks->user, f->r, err);
            if (status != STATUS_OK)
                return status;
        }
    }
    return save(f, err);
}

static void count_rays(struct refine *f) {
    for (int t = 0; t < parallel_thread_count(f->r->pool); t++) {
        uint64_t rays, dropped;
        path_batch_counts(f->batch[t].paths, &rays, &dropped);
        f->counters.ray_count += rays;
        f->counters.dropped_count += dropped;
    }
}

/* The segments that emit or came near it, with the evidence. */
static cJSON *emitter_list(const struct refine *f) {
    cJSON *list = cJSON_CreateArray();
    for (size_t s = 0; s < f->r->segments.count; s++) {
        if (!f->r->is_emitter[s] && f->r->evidence[s].share < REPORTED_SHARE)
            continue;
        cJSON *entry = cJSON_CreateObject();
        json_add_int(entry, "segment", (int64_t)s);
        json_add_int(entry, "object_id", f->r->segments.id[s]);
        json_add_bool(entry, "is_emitter", f->r->is_emitter[s]);
        json_add_number(entry, "share_beyond_reflection", (double)f->r->evidence[s].share);
        const rgb *e = &f->r->materials.emission[s];
        const double radiance[3] = {(double)e->r, (double)e->g, (double)e->b};
        json_add(entry, "radiance", cJSON_CreateDoubleArray(radiance, 3));
        cJSON_AddItemToArray(list, entry);
    }
    return list;
}

static void report(struct refine *f) {
    const struct counters *c = &f->counters;
    cJSON *figures = cJSON_CreateObject();
    json_add_int(figures, "iterations", (int64_t)c->iteration);
    json_add_int(figures, "paths", (int64_t)c->path_count);
    json_add_int(figures, "rays_this_attempt", (int64_t)c->ray_count);
    json_add_int(figures, "non_finite_samples_dropped_this_attempt", (int64_t)c->dropped_count);
    json_add_number(figures, "paths_per_second",
                    c->elapsed_sec > 0.0 ? (double)c->path_count / c->elapsed_sec : 0.0);
    json_add_number(figures, "paths_per_texel",
                    (double)c->path_count / (double)f->r->inverse.valid_count);
    json_add(f->r->report, "refine", figures);
    json_add(f->r->report, "emitters", emitter_list(f));
    cJSON *series = cJSON_AddObjectToObject(f->r->report, "series");
    cJSON *curve = cJSON_AddArrayToObject(series, "loss");
    for (int i = 0; i < CURVE_POINTS; i++) {
        if (c->curve_count[i] == 0.0)
            continue;
        const double point[2] = {(double)i / (CURVE_POINTS - 1), c->curve_sum[i] / c->curve_count[i]};
        cJSON_AddItemToArray(curve, cJSON_CreateDoubleArray(point, 2));
    }
}

static float neutral_share(rgb shown, float median) {
    float q = rgb_mean(shown) / median;
    return q * q / (q * q + NEUTRAL_BRIGHTNESS * NEUTRAL_BRIGHTNESS);
}

static void start_neutral(struct refine *f) {
    struct reconstruction *r = f->r;
    start_base_color(f);
    emitters_observe(r, f->views, r->evidence);
    for (size_t s = 0; s < r->segments.count; s++)
        r->materials.emission[s] =
            rgb_scale(r->evidence[s].shown, neutral_share(r->evidence[s].shown, f->views->median_radiance));
}

struct refine *listing1_new(struct reconstruction *r, const struct views *views,
                            const struct reconstruct_hooks *hooks) {
    const struct settings *set = r->settings;
    struct refine *f = mem_alloc(sizeof *f);
    *f = (struct refine){.r = r, .views = views, .hooks = hooks};
    f->solved = settings_is(set, "method", "solve");
    f->one_estimate = settings_is(set, "estimates", "one");
    f->by_pixels = settings_is(set, "choose", "pixels");
    f->any_emits = settings_is(set, "emitters", "any");
    f->coarse_levels = (int)settings_number(set, "coarse_levels");
    f->iteration_limit = (uint64_t)settings_number(set, "iterations");
    f->time_limit_sec = settings_number(set, "time_limit_sec");
    f->path = (struct path_settings){
        .max_depth = (int)settings_number(set, "max_depth"),
        .roulette_depth = (int)settings_number(set, "roulette_depth"),
        .derivatives = !f->solved, /* from there no path is walked backwards */
        .seed = (uint64_t)settings_number(set, "seed"),
        .least_color = f->solved ? 0.0f : PATH_LEAST_COLOR, /* steps from a solved start go by radiance */
    };
    f->counters.level = f->coarse_levels;
    if (!f->solved)
        start_neutral(f);
    params_init(&f->params, &r->materials, &r->inverse, &r->segments, r->atlas.chart_of_triangle,
                f->coarse_levels);
    chooser_init(&f->chooser, r->inverse.valid_count,
                 (size_t)settings_number(set, "texels_per_iteration"), f->path.seed);
    f->gradient = gradient_new(r->atlas.width, r->atlas.height, r->segments.count);
    f->chunk_count = (f->chooser.stratum_count + CHUNK_TEXELS - 1) / CHUNK_TEXELS;
    f->log = mem_array(f->chunk_count, sizeof *f->log);
    for (size_t c = 0; c < f->chunk_count; c++)
        f->log[c] = gradient_log_new(r->segments.count);
    f->chunk_loss = mem_calloc(f->chunk_count, sizeof *f->chunk_loss);
    f->chunk_looks = mem_calloc(f->chunk_count, sizeof *f->chunk_looks);
    int threads = parallel_thread_count(r->pool);
    f->batch = mem_calloc((size_t)threads, sizeof *f->batch);
    for (int t = 0; t < threads; t++)
        look_batch_init(&f->batch[t], r, views, &f->path, (int)settings_number(set, "cameras_per_texel"),
                        (int)settings_number(set, "samples_per_camera"), CHUNK_TEXELS);
    f->look_capacity = f->batch[0].look_capacity;
    f->seen = mem_calloc(f->chunk_count * f->look_capacity, sizeof *f->seen);
    return f;
}

void listing1_free(struct refine *f) {
    for (int t = 0; t < parallel_thread_count(f->r->pool); t++)
        look_batch_release(&f->batch[t]);
    mem_free(f->batch);
    mem_free(f->seen);
    mem_free(f->chunk_looks);
    mem_free(f->chunk_loss);
    for (size_t c = 0; c < f->chunk_count; c++)
        gradient_log_free(f->log[c]);
    mem_free(f->log);
    gradient_free(f->gradient);
    params_release(&f->params);
    mem_free(f);
}

enum status listing1_run(struct refine *f, struct error *err) {
    enum status status = loop(f, err);
    count_rays(f);
    if (status == STATUS_OK)
        report(f);
    return status;
}
