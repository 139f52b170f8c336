/* optimiser.c -- see optimiser.h. */
#include "server/refine/optimiser.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>

#include "common/clock.h"
#include "common/mem.h"
#include "server/state/evidence.h"

/* Step sizes fall as 1 / (1 + RATE_FALL t), t in [0, 1]. */
#define RATE_FALL 15.0

/* Seconds between two messages of progress. */
#define TELL_SEC 1.0

void optimiser_keep(struct optimiser *o, const char *name, void *data, size_t bytes) {
    assert(o->state_count < OPTIMISER_ARRAYS);
    o->state[o->state_count++] = (struct state_array){name, data, bytes};
}

static void keep_common(struct optimiser *o) {
    struct reconstruction *r = o->r;
    struct materials *m = &r->materials;
    size_t segments = r->segments.count;
    size_t texels = (size_t)m->base_color.width * m->base_color.height;
    optimiser_keep(o, "counters", &o->counters, sizeof o->counters);
    optimiser_keep(o, "base_color", m->base_color.texel, texels * sizeof *m->base_color.texel);
    optimiser_keep(o, "roughness", m->roughness, segments * sizeof *m->roughness);
    optimiser_keep(o, "specular", m->specular, segments * sizeof *m->specular);
    optimiser_keep(o, "emission", m->emission, segments * sizeof *m->emission);
    optimiser_keep(o, "emission.log", o->emission.log_radiance, segments * sizeof *o->emission.log_radiance);
    optimiser_keep(o, "emission.adam", o->emission.adam.record, adam_bytes(&o->emission.adam));
    optimiser_keep(o, "emission.evidence", r->evidence, segments * sizeof *r->evidence);
    optimiser_keep(o, "environment.factor", &r->sky_factor, sizeof r->sky_factor);
    optimiser_keep(o, "sun.irradiance", &r->sun.irradiance, sizeof r->sun.irradiance);
    optimiser_keep(o, "emission.is_emitter", r->is_emitter, segments * sizeof *r->is_emitter);
}

struct optimiser *optimiser_new(struct reconstruction *r, const struct views *views,
                                const struct reconstruct_hooks *hooks, bool derivatives,
                                const struct optimiser_method *method, void *self) {
    const struct settings *set = r->settings;
    struct optimiser *o = mem_alloc(sizeof *o);
    *o = (struct optimiser){.r = r, .views = views, .hooks = hooks, .method = method, .self = self};
    o->iteration_limit = (uint64_t)settings_number(set, "iterations");
    o->time_limit_sec = settings_number(set, "time_limit_sec");
    const struct path_settings path = {
        .max_depth = (int)settings_number(set, "max_depth"),
        .roulette_depth = (int)settings_number(set, "roulette_depth"),
        .derivatives = derivatives,
        .seed = (uint64_t)settings_number(set, "seed"),
        .least_color = derivatives ? PATH_LEAST_COLOR : 0.0f,
    };
    pass_init(&o->pass, r, views, &path);
    emission_init(&o->emission, &r->materials);
    keep_common(o);
    return o;
}

void optimiser_free(struct optimiser *o) {
    o->method->free(o->self);
    emission_release(&o->emission);
    pass_release(&o->pass);
    mem_free(o);
}

/* How much of the run is done, in [0, 1]. */
static double fraction_done(const struct optimiser *o) {
    double fraction = o->iteration_limit
                          ? (double)o->counters.iteration / (double)o->iteration_limit
                          : o->counters.elapsed_sec / o->time_limit_sec;
    if (!o->iteration_limit && o->method->done)
        fraction = fmax(fraction, o->method->done(o->self));
    return fraction < 1.0 ? fraction : 1.0;
}

float optimiser_rate_fall(double fraction) {
    double since = fmax(0.0, (fraction - OPTIMISER_FALL_FROM) / (1.0 - OPTIMISER_FALL_FROM));
    return (float)(1.0 / (1.0 + RATE_FALL * since));
}

enum status optimiser_save(struct optimiser *o, struct error *err) {
    return o->hooks->checkpoint_save(o->hooks->user, (long)o->counters.iteration, o->state, o->state_count, err);
}

/* The run was extended: what the curve has lies in a smaller part of it. */
static void redraw_curve(struct optimiser *o) {
    struct optimiser_counters *c = &o->counters;
    double planned = o->iteration_limit ? (double)o->iteration_limit : o->time_limit_sec;
    for (size_t i = 0; planned > c->planned && i < OPTIMISER_CURVE_POINTS; i++) {
        size_t bin = (size_t)((double)i * c->planned / planned);
        double sum = c->curve_sum[i], count = c->curve_count[i];
        c->curve_sum[i] = c->curve_count[i] = 0.0;
        c->curve_sum[bin] += sum;
        c->curve_count[bin] += count;
    }
    c->planned = planned;
}

enum status optimiser_load(struct optimiser *o, bool *found, struct error *err) {
    enum status status =
        o->hooks->checkpoint_load(o->hooks->user, o->state, o->state_count, found, err);
    redraw_curve(o);
    if (status != STATUS_OK || !*found)
        return status;
    char line[128];
    snprintf(line, sizeof line, "resumed at iteration %llu", (unsigned long long)o->counters.iteration);
    o->hooks->log(o->hooks->user, line);
    o->method->resumed(o->self);
    return STATUS_OK;
}

/* One iteration; returns the mean loss of its looks. */
static double iterate(struct optimiser *o, double fraction) {
    struct optimiser_counters *c = &o->counters;
    /* First, since after a resume the lights are not yet those of the materials. */
    world_update_lights(&o->r->world);
    o->method->iterate(o->self, fraction);
    double loss = pass_mean_loss(&o->pass);
    size_t bin = (size_t)(fraction * (OPTIMISER_CURVE_POINTS - 1));
    c->curve_sum[bin] += loss;
    c->curve_count[bin] += 1.0;
    c->path_count += pass_look_count(&o->pass) * (size_t)o->pass.batch[0].samples;
    c->iteration++;
    return loss;
}

/* Seconds that iterations will still take, after the first. */
static double seconds_left(const struct optimiser *o) {
    const struct optimiser_counters *c = &o->counters;
    double done = o->iteration_limit ? (double)c->iteration / (double)o->iteration_limit
                  : o->method->done  ? o->method->done(o->self)
                                     : 0.0;
    double by_work = done > 0.0 ? fmax(c->iterate_sec * (1.0 / done - 1.0), 0.0) : INFINITY;
    return o->iteration_limit ? by_work : fmin(by_work, fmax(o->time_limit_sec - c->elapsed_sec, 0.0));
}

/* How far it is, after an iteration of this loss. */
static void tell(const struct optimiser *o, double loss) {
    const struct reconstruct_hooks *hooks = o->hooks;
    long iteration = (long)o->counters.iteration;
    uint64_t rays, dropped;
    pass_ray_counts(&o->pass, &rays, &dropped);
    hooks->progress(hooks->user, "refine", fraction_done(o), 1.0, seconds_left(o));
    hooks->metric(hooks->user, "loss", iteration, loss);
    hooks->metric(hooks->user, "rays", iteration, (double)rays); /* of this attempt */
}

static enum status loop(struct optimiser *o, struct error *err) {
    const struct reconstruct_hooks *hooks = o->hooks;
    double told = 0.0;
    for (;;) {
        double begin = clock_sec(), fraction = fraction_done(o);
        if (fraction >= 1.0)
            break;
        double loss = iterate(o, fraction);
        double end = clock_sec();
        o->counters.elapsed_sec += end - begin;
        o->counters.iterate_sec += end - begin;
        if (end - told > TELL_SEC || fraction_done(o) >= 1.0) {
            told = end;
            tell(o, loss);
        }
        bool stop = hooks->stop_requested(hooks->user);
        if (stop || hooks->checkpoint_due(hooks->user)) {
            enum status status = optimiser_save(o, err);
            if (status != STATUS_OK)
                return status;
        }
        if (stop)
            return error_set(err, STATUS_CANCELLED, "stopped at iteration %llu",
                             (unsigned long long)o->counters.iteration);
        if (hooks->preview_due(hooks->user)) {
            enum status status = hooks->preview(hooks->user, o->r, err);
            if (status != STATUS_OK)
                return status;
        }
    }
    if (o->method->finish)
        o->method->finish(o->self);
    o->counters.elapsed_sec = fmax(o->counters.elapsed_sec, o->time_limit_sec); /* extended, it goes on for that long */
    return optimiser_save(o, err);
}

static cJSON *curve_points(const struct optimiser_counters *c) {
    cJSON *curve = cJSON_CreateArray();
    for (int i = 0; i < OPTIMISER_CURVE_POINTS; i++) {
        if (c->curve_count[i] == 0.0)
            continue;
        const double point[2] = {(double)i / (OPTIMISER_CURVE_POINTS - 1), c->curve_sum[i] / c->curve_count[i]};
        cJSON_AddItemToArray(curve, cJSON_CreateDoubleArray(point, 2));
    }
    return curve;
}

static void report(const struct optimiser *o) {
    const struct optimiser_counters *c = &o->counters;
    cJSON *figures = cJSON_AddObjectToObject(o->r->report, "refine");
    uint64_t rays, dropped;
    pass_ray_counts(&o->pass, &rays, &dropped);
    json_add_int(figures, "iterations", (int64_t)c->iteration);
    json_add_int(figures, "paths", (int64_t)c->path_count);
    json_add_int(figures, "rays_this_attempt", (int64_t)rays);
    json_add_int(figures, "non_finite_samples_dropped_this_attempt", (int64_t)dropped);
    json_add_number(figures, "paths_per_second",
                    c->iterate_sec > 0.0 ? (double)c->path_count / c->iterate_sec : 0.0);
    json_add_number(figures, "paths_per_texel",
                    (double)c->path_count / (double)o->r->inverse.valid_count);
    cJSON *series = cJSON_AddObjectToObject(o->r->report, "series");
    json_add(series, "loss", curve_points(c));
}

enum status optimiser_run(struct optimiser *o, struct error *err) {
    enum status status = loop(o, err);
    if (status == STATUS_OK)
        report(o);
    return status;
}
