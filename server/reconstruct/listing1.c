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
#include "server/reconstruct/loss.h"
#include "server/reconstruct/params.h"
#include "server/render/path.h"

#define CHUNK_TEXELS 32
#define CURVE_POINTS 256

/* Weight of a photograph's pixel that mixes surfaces: it speaks only where nothing else does. */
#define UNCLEAN_TRUST 0.02f

/* Parts of the run, as fractions of it: the coarse levels share the first, all get equal time;
 * the decision about emitters falls into the second coarse level. */
#define COARSE_PART 0.4
#define DECISION_AT 0.12

/* The neutral start of emission: this share of what the photographs show of a segment is its own
 * light, the rest is reflected. A segment that no photograph shows does not emit. */
#define NEUTRAL_EMISSION_SHARE 0.5f
/* Downward push on emission before the decision, in Adam steps (whose size is at most about 1). */
#define EMISSION_DECAY 0.25f
/* Emission moves at this share of its rate once it starts from what is seen. */
#define DECIDED_EMISSION_RATE 0.2f
/* Step sizes fall to this share of the first at the end of the run. */
#define FINAL_RATE 0.02
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
};

struct refine {
    struct reconstruction *r;
    const struct views *views;
    const struct reconstruct_hooks *hooks;
    struct params params;
    struct chooser chooser;
    struct counters counters;
    rgb *observed;         /* [segment_count] radiance that the photographs show of it */
    float *emission_share; /* [segment_count] evidence of the decision */
    struct path_settings path;
    struct gradient *gradient;
    size_t chunk_count;
    struct gradient_log **log; /* [chunk_count] */
    double *chunk_loss;        /* [chunk_count] sum of loss estimates */
    size_t *chunk_pairs;       /* [chunk_count] texel-photograph pairs */
    struct seen_emission *seen; /* [chunk_count][pairs a chunk] of each pair, in order */
    size_t chunk_pair_capacity;
    int cameras, samples;      /* a texel's photographs; paths for each */
    size_t batch_capacity;
    struct scratch *scratch;   /* [threads] */
    uint64_t iteration_limit;  /* 0: by time */
    double time_limit_sec;
    int coarse_levels;
};

/* A texel-photograph pair: paths [first, first + samples) of the batch. */
struct pair {
    size_t first;
    uint32_t photograph;
    uint32_t segment; /* that the texel belongs to */
    float trust;      /* 1, or UNCLEAN_TRUST where the photograph's pixel mixes surfaces */
};

/* Derivative of a pair's loss by the emission of the segment that it looks at. Only what is seen
 * of a segment moves its emission. What it sheds on other surfaces is left out: there emission and
 * base colour can stand in for each other (the bias that this accepts: none at the optimum, where
 * both derivatives are 0), and while base colours are still too dark it would drive the lamps up. */
struct seen_emission {
    uint32_t segment;
    rgb d_emission;
};

struct scratch {
    struct path_batch *batch;
    struct ray *ray;
    struct path_key *key;
    struct photograph_sample *reference;
    rgb *radiance, *d_radiance;
    struct pair *pair;
    uint64_t ray_count_before, dropped_before;
};

static void scratch_init(struct scratch *s, size_t capacity, size_t pairs, int max_depth) {
    s->batch = path_batch_new(capacity, max_depth);
    s->ray = mem_array(capacity, sizeof *s->ray);
    s->key = mem_array(capacity, sizeof *s->key);
    s->reference = mem_array(capacity, sizeof *s->reference);
    s->radiance = mem_array(capacity, sizeof *s->radiance);
    s->d_radiance = mem_array(capacity, sizeof *s->d_radiance);
    s->pair = mem_array(pairs, sizeof *s->pair);
}

static void scratch_release(struct scratch *s) {
    path_batch_free(s->batch);
    mem_free(s->ray);
    mem_free(s->key);
    mem_free(s->reference);
    mem_free(s->radiance);
    mem_free(s->d_radiance);
    mem_free(s->pair);
}

/* Adds the paths of one texel seen by one photograph; false when a sample cannot be used: out of
 * the picture, masked, or in a pixel that mixes surfaces while the texel's centre is not. */
static bool add_pair(const struct refine *f, struct scratch *s, size_t first, uint32_t texel,
                     const struct view *view, uint32_t sample_number) {
    const struct reconstruction *r = f->r;
    const struct photograph *photo = &r->scene->photograph[f->views->train[view->train]];
    bool clean = views_clean(f->views, view);
    uint32_t x = texel % r->atlas.width, y = texel / r->atlas.width;
    for (int i = 0; i < f->samples; i++) {
        /* The halves must be independent, and samples of one key are stratified against each
         * other: each half has a key of its own. */
        struct path_key key = {texel, (uint32_t)(2 * f->counters.iteration) + (uint32_t)(i & 1),
                               sample_number + (uint32_t)i / 2};
        /* Where in the texel: the photograph saw all of it, not its centre. */
        uint64_t bits = rng_key(f->path.seed ^ key.iteration, key.index, key.sample);
        uint32_t triangle;
        float b1, b2, depth_m;
        struct view place = *view;
        if (!inverse_uv_lookup(&r->inverse, &r->atlas, (float)x + rng_to_float((uint32_t)bits),
                               (float)y + rng_to_float((uint32_t)(bits >> 32)), &triangle, &b1, &b2))
            return false;
        vec3 point = mesh_point(&r->scene->mesh, triangle, b1, b2);
        size_t at = first + (size_t)i;
        if (!camera_project(&photo->camera, point, &place.x, &place.y, &depth_m) ||
            (clean && !views_clean(f->views, &place)) ||
            !photograph_sample(photo, place.x, place.y, &s->reference[at]))
            return false;
        vec3 origin = camera_origin(&photo->camera);
        s->ray[at] = (struct ray){origin, vec3_normalize(vec3_sub(point, origin))};
        s->key[at] = key;
    }
    return true;
}

/* Chooses cameras for one texel and adds its paths; returns the number of pairs in the scratch. */
static size_t add_texel(const struct refine *f, struct scratch *s, uint32_t texel, size_t pair_count) {
    const struct reconstruction *r = f->r;
    uint32_t triangle;
    float b1, b2;
    if (!inverse_uv_lookup(&r->inverse, &r->atlas, (float)(texel % r->atlas.width) + 0.5f,
                           (float)(texel / r->atlas.width) + 0.5f, &triangle, &b1, &b2))
        return pair_count;
    vec3 normal = vec3_normalize(mesh_cross(&r->scene->mesh, triangle));
    vec3 point = mesh_point(&r->scene->mesh, triangle, b1, b2);
    struct view view[VIEWS_PICK_MAX];
    uint32_t key = (uint32_t)rng_key(f->path.seed, f->counters.iteration, texel);
    size_t seen = views_pick(f->views, point, normal, key, (size_t)f->cameras, view);
    for (size_t k = 0; k < seen; k++) {
        size_t first = pair_count * (size_t)f->samples;
        uint32_t photograph = f->views->train[view[k].train];
        if (add_pair(f, s, first, texel, &view[k], (uint32_t)(k * ((size_t)f->samples + 1) / 2)))
            s->pair[pair_count++] =
                (struct pair){first, photograph, r->segments.of_triangle[triangle],
                              views_clean(f->views, &view[k]) ? 1.0f : UNCLEAN_TRUST};
    }
    return pair_count;
}

static void run_chunk(void *user, size_t chunk, int thread) {
    struct refine *f = user;
    struct scratch *s = &f->scratch[thread];
    struct gradient_log *log = f->log[chunk];
    gradient_log_clear(log);
    f->chunk_loss[chunk] = 0.0;
    size_t pairs = 0, end = (chunk + 1) * CHUNK_TEXELS;
    for (size_t i = chunk * CHUNK_TEXELS; i < end && i < f->chooser.stratum_count; i++) {
        size_t item = chooser_item(&f->chooser, f->counters.iteration, i);
        if (item != CHOOSE_NONE)
            pairs = add_texel(f, s, f->r->inverse.valid[item], pairs);
    }
    f->chunk_pairs[chunk] = pairs;
    if (pairs == 0)
        return;
    size_t paths = pairs * (size_t)f->samples;
    path_batch_trace(s->batch, &f->r->world, &f->path, paths, s->ray, s->key, s->radiance);
    double loss = 0.0;
    for (size_t i = 0; i < pairs; i++) {
        size_t first = s->pair[i].first;
        loss += (double)loss_pair(&f->r->scene->photograph[s->pair[i].photograph],
                                  s->reference + first, s->radiance + first, f->samples,
                                  f->views->median_radiance, s->d_radiance + first);
        struct seen_emission *seen = &f->seen[chunk * f->chunk_pair_capacity + i];
        *seen = (struct seen_emission){s->pair[i].segment, {0, 0, 0}};
        for (int k = 0; k < f->samples; k++) {
            rgb *d = &s->d_radiance[first + (size_t)k];
            *d = rgb_scale(*d, s->pair[i].trust);
            seen->d_emission = rgb_add(seen->d_emission, *d);
        }
    }
    f->chunk_loss[chunk] = loss;
    path_batch_backward(s->batch, &f->r->world, s->d_radiance, log);
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
    if (f->coarse_levels == 0 || fraction >= COARSE_PART)
        return 0;
    return f->coarse_levels - (int)(fraction / COARSE_PART * f->coarse_levels);
}

static struct params_rates rates_at(const struct refine *f, double fraction) {
    const struct settings *set = f->r->settings;
    float fall = (float)(FINAL_RATE + (1.0 - FINAL_RATE) * 0.5 * (1.0 + cos(M_PI * fraction)));
    return (struct params_rates){
        .base_color = fall * (float)settings_number(set, "base_color_rate"),
        .roughness = fall * (float)settings_number(set, "roughness_rate"),
        .specular = fall * (float)settings_number(set, "specular_rate"),
        .emission = fall * (f->counters.decided ? DECIDED_EMISSION_RATE : 1.0f) *
                    (float)settings_number(set, "emission_rate"),
        .emission_decay = f->counters.decided ? 0.0f : EMISSION_DECAY,
    };
}

static void decide_emitters(struct refine *f) {
    struct reconstruction *r = f->r;
    emitters_decide(&r->materials, f->observed, r->is_emitter, f->emission_share);
    params_fix_emitters(&f->params, r->is_emitter);
    /* By now emission also made up for walls that were too dark; what is seen of the emitter
     * itself is the better place to go on from. */
    for (size_t s = 0; s < r->segments.count; s++) {
        if (r->is_emitter[s])
            params_set_emission(&f->params, s, f->observed[s]);
    }
    f->counters.decided = 1;
}

/* Replaces the derivative by emission with that of what is seen; see struct seen_emission. */
static void reduce_seen_emission(struct refine *f) {
    struct gradient *g = f->gradient;
    memset(g->d_emission, 0, g->segment_count * sizeof *g->d_emission);
    for (size_t c = 0; c < f->chunk_count; c++) {
        const struct seen_emission *seen = &f->seen[c * f->chunk_pair_capacity];
        for (size_t i = 0; i < f->chunk_pairs[c]; i++) {
            double *d = g->d_emission[seen[i].segment];
            d[0] += (double)seen[i].d_emission.r;
            d[1] += (double)seen[i].d_emission.g;
            d[2] += (double)seen[i].d_emission.b;
        }
    }
}

/* One pass of Listing 1; returns the mean loss of its texel-photograph pairs. */
static double iterate(struct refine *f, double fraction) {
    if (!f->counters.decided && fraction >= DECISION_AT)
        decide_emitters(f);
    if (f->counters.level != level_at(f, fraction)) {
        f->counters.level = level_at(f, fraction);
        params_refine(&f->params, f->counters.level);
    }
    world_update_lights(&f->r->world);
    parallel_for(f->r->pool, f->chunk_count, run_chunk, f);
    gradient_reduce(f->gradient, f->log, f->chunk_count, f->r->pool);
    reduce_seen_emission(f);
    struct params_rates rates = rates_at(f, fraction);
    params_step(&f->params, f->gradient, &rates, f->r->pool);
    double loss = 0.0;
    size_t pairs = 0;
    for (size_t c = 0; c < f->chunk_count; c++) {
        loss += f->chunk_loss[c];
        pairs += f->chunk_pairs[c];
    }
    f->counters.path_count += pairs * (size_t)f->samples;
    double mean = pairs ? loss / (double)pairs : 0.0;
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
#define ADD_ADAM(name_, adam_)                                                                  \
    ADD(name_ ".mean", (adam_)->mean, (adam_)->count * (size_t)(adam_)->width * sizeof(float)); \
    ADD(name_ ".square", (adam_)->square,                                                       \
        (adam_)->count * (size_t)(adam_)->width * sizeof(float));                               \
    ADD(name_ ".touches", (adam_)->touch_count, (adam_)->count * sizeof(uint16_t))
    ADD("counters", &f->counters, sizeof f->counters);
    ADD("base_color", m->base_color.texel, texels * sizeof *m->base_color.texel);
    ADD("roughness", m->roughness, segments * sizeof *m->roughness);
    ADD("specular", m->specular, segments * sizeof *m->specular);
    ADD("emission", m->emission, segments * sizeof *m->emission);
    ADD("emission.log", p->log_emission, segments * sizeof *p->log_emission);
    ADD("emission.share", f->emission_share, segments * sizeof *f->emission_share);
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

static enum status load(struct refine *f, struct error *err) {
    struct state_array array[24];
    size_t count = state_arrays(f, array);
    bool found;
    enum status status = f->hooks->checkpoint_load(f->hooks->user, array, count, &found, err);
    if (status == STATUS_OK && found) {
        params_set_level(&f->params, f->counters.level);
        if (f->counters.decided)
            params_fix_emitters(&f->params, f->r->is_emitter);
    }
    return status;
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
        if (end - told > 1.0) {
            told = end;
            fraction = fraction_done(f);
            double left = fraction > 0.0 ? f->counters.elapsed_sec * (1.0 / fraction - 1.0) : -1.0;
            hooks->progress(hooks->user, "refine", fraction, 1.0, left);
            hooks->metric(hooks->user, "loss", (long)f->counters.iteration, loss);
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
        path_batch_counts(f->scratch[t].batch, &rays, &dropped);
        f->counters.ray_count += rays;
        f->counters.dropped_count += dropped;
    }
}

/* The segments that emit or came near it, with the evidence. */
static cJSON *emitter_list(const struct refine *f) {
    cJSON *list = cJSON_CreateArray();
    for (size_t s = 0; s < f->r->segments.count; s++) {
        if (!f->r->is_emitter[s] && f->emission_share[s] < REPORTED_SHARE)
            continue;
        cJSON *entry = cJSON_CreateObject();
        json_add_int(entry, "segment", (int64_t)s);
        json_add_int(entry, "object_id", f->r->segments.id[s]);
        json_add_bool(entry, "is_emitter", f->r->is_emitter[s]);
        json_add_number(entry, "share_of_observed_radiance", (double)f->emission_share[s]);
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

/* Gives every block of the coarsest level a mid grey on average and, within it, the detail that the
 * photographs show: light hardly changes over a few texels, so their ratios are the surface's. */
static void start_from_detail(struct refine *f) {
    struct texture *texture = &f->r->materials.base_color;
    const struct observed *o = &f->r->observed;
    uint32_t side = 1u << f->coarse_levels;
    for (uint32_t y0 = 0; y0 < texture->height; y0 += side) {
        for (uint32_t x0 = 0; x0 < texture->width; x0 += side) {
            double sum[3] = {0}, count = 0.0;
            for (int pass = 0; pass < 2; pass++) {
                for (uint32_t y = y0; y < y0 + side && y < texture->height; y++) {
                    for (uint32_t x = x0; x < x0 + side && x < texture->width; x++) {
                        size_t texel = (size_t)y * texture->width + x;
                        if (texture->texel[texel][3] == 0.0f || o->radiance[texel][0] == 0)
                            continue;
                        count += pass == 0;
                        for (int c = 0; c < 3; c++) {
                            double value = log((double)image_float_from_half(o->radiance[texel][c]));
                            if (pass == 0)
                                sum[c] += value;
                            else
                                texture->texel[texel][c] *= (float)exp(value - sum[c] / count);
                        }
                    }
                }
            }
        }
    }
}

static void refine_init(struct refine *f, struct reconstruction *r, const struct views *views,
                        const struct reconstruct_hooks *hooks) {
    const struct settings *set = r->settings;
    *f = (struct refine){.r = r, .views = views, .hooks = hooks};
    f->coarse_levels = (int)settings_number(set, "coarse_levels");
    f->iteration_limit = (uint64_t)settings_number(set, "iterations");
    f->time_limit_sec = settings_number(set, "time_limit_sec");
    f->cameras = (int)settings_number(set, "cameras_per_texel");
    f->samples = (int)settings_number(set, "samples_per_camera");
    f->path = (struct path_settings){
        .max_depth = (int)settings_number(set, "max_depth"),
        .roulette_depth = (int)settings_number(set, "roulette_depth"),
        .seed = (uint64_t)settings_number(set, "seed"),
    };
    f->counters.level = f->coarse_levels;
    if (settings_bool(set, "guided"))
        start_from_detail(f);
    f->observed = mem_calloc(r->segments.count, sizeof *f->observed);
    emitters_observe(r, views, f->observed);
    for (size_t s = 0; s < r->segments.count; s++)
        r->materials.emission[s] = rgb_scale(f->observed[s], NEUTRAL_EMISSION_SHARE);
    params_init(&f->params, &r->materials, &r->inverse, &r->segments, f->coarse_levels);
    f->emission_share = mem_calloc(r->segments.count, sizeof *f->emission_share);
    chooser_init(&f->chooser, r->inverse.valid_count,
                 (size_t)settings_number(set, "texels_per_iteration"), f->path.seed);
    f->gradient = gradient_new(r->atlas.width, r->atlas.height, r->segments.count);
    f->chunk_count = (f->chooser.stratum_count + CHUNK_TEXELS - 1) / CHUNK_TEXELS;
    f->log = mem_array(f->chunk_count, sizeof *f->log);
    for (size_t c = 0; c < f->chunk_count; c++)
        f->log[c] = gradient_log_new(r->segments.count);
    f->chunk_loss = mem_calloc(f->chunk_count, sizeof *f->chunk_loss);
    f->chunk_pairs = mem_calloc(f->chunk_count, sizeof *f->chunk_pairs);
    size_t pairs = f->chunk_pair_capacity = (size_t)CHUNK_TEXELS * (size_t)f->cameras;
    f->seen = mem_calloc(f->chunk_count * pairs, sizeof *f->seen);
    int threads = parallel_thread_count(r->pool);
    f->scratch = mem_calloc((size_t)threads, sizeof *f->scratch);
    for (int t = 0; t < threads; t++)
        scratch_init(&f->scratch[t], pairs * (size_t)f->samples, pairs, f->path.max_depth);
}

static void refine_release(struct refine *f) {
    for (int t = 0; t < parallel_thread_count(f->r->pool); t++)
        scratch_release(&f->scratch[t]);
    mem_free(f->scratch);
    mem_free(f->seen);
    mem_free(f->chunk_pairs);
    mem_free(f->chunk_loss);
    for (size_t c = 0; c < f->chunk_count; c++)
        gradient_log_free(f->log[c]);
    mem_free(f->log);
    gradient_free(f->gradient);
    mem_free(f->emission_share);
    mem_free(f->observed);
    params_release(&f->params);
}

enum status listing1_run(struct reconstruction *r, const struct views *views,
                         const struct reconstruct_hooks *hooks, struct error *err) {
    struct refine f;
    refine_init(&f, r, views, hooks);
    enum status status = load(&f, err);
    if (status == STATUS_OK && f.counters.iteration > 0) {
        char line[128];
        snprintf(line, sizeof line, "resumed at iteration %llu",
                 (unsigned long long)f.counters.iteration);
        hooks->log(hooks->user, line);
    }
    if (status == STATUS_OK)
        status = loop(&f, err);
    count_rays(&f);
    if (status == STATUS_OK)
        report(&f);
    refine_release(&f);
    return status;
}
