/* optimiser.c -- see optimiser.h. */
#include "server/refine/optimiser.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>

#include "common/hash64.h"
#include "common/mem.h"

/* Step sizes fall as 1 / (1 + RATE_FALL t), t in [0, 1], to a sixteenth: steps that fall as 1 / t average the noise of
 * gradients (Robbins & Monro 1951). */
#define RATE_FALL 15.0 /* +25 %: -0.17 dB, roughness -0.12, specular -0.10 */

/* Attempted observations per wanted one after which a run ends even if most of the surface is not observed:
 * ten where a tenth of it is. */
#define MAX_VISITS 10.0 /* +25 %: no change */

/* As optimiser_add_state, for an array that checkpoints of formats before `format` (state_array.h) lack: it is left as
 * it is then. */
static void keep_since(struct optimiser *o, int format, const char *name, void *data, size_t bytes) {
    assert(o->state_count < OPTIMISER_ARRAYS);
    o->state[o->state_count++] = (struct state_array){name, data, bytes, format};
}

void optimiser_add_state(struct optimiser *o, const char *name, void *data, size_t bytes) {
    keep_since(o, 1, name, data, bytes);
}

/* Hash of the numbering of texels and segments, which the arrays of a checkpoint depend on. */
static uint64_t hash_surface(const struct surface *s) {
    size_t texels = (size_t)s->inverse->width * s->inverse->height, triangles = s->mesh->triangle_count;
    uint64_t of_texels = hash64(s->inverse->triangle, texels * sizeof *s->inverse->triangle, s->inverse->width);
    return hash64(s->segments->of_triangle, triangles * sizeof *s->segments->of_triangle, of_texels);
}

static void keep_common(struct optimiser *o) {
    const struct optimiser_input *in = &o->in;
    struct materials *m = in->materials;
    size_t segments = in->surface.segments->count;
    size_t texels = (size_t)m->base_color.width * m->base_color.height;
    optimiser_add_state(o, "counters", &o->counters, sizeof o->counters);
    optimiser_add_state(o, "base_color", m->base_color.texel, texels * sizeof *m->base_color.texel);
    optimiser_add_state(o, "roughness", m->roughness, segments * sizeof *m->roughness);
    optimiser_add_state(o, "specular", m->specular, segments * sizeof *m->specular);
    optimiser_add_state(o, "emission", m->emission, segments * sizeof *m->emission);
    optimiser_add_state(o, "emission.log", o->emission.log_radiance, segments * sizeof *o->emission.log_radiance);
    optimiser_add_state(o, "emission.adam", o->emission.adam.record, adam_bytes(&o->emission.adam));
    optimiser_add_state(o, "emission.evidence", in->evidence, segments * sizeof *in->evidence);
    optimiser_add_state(o, "environment.factor", in->sky_factor, sizeof *in->sky_factor);
    keep_since(o, 3, "light", in->light, offsetof(struct estimated_light, ground_factor));
    keep_since(o, 5, "light.ground", in->light->ground_factor, sizeof in->light->ground_factor);
    keep_since(o, 6, "light.deviation", &in->light->deviation, sizeof in->light->deviation);
    keep_since(o, 4, "deviation", m->deviation, texels * sizeof *m->deviation);
    optimiser_add_state(o, "sun.irradiance", in->sun_irradiance, sizeof *in->sun_irradiance);
    optimiser_add_state(o, "emission.is_emitter", in->is_emitter, segments * sizeof *in->is_emitter);
    keep_since(o, 2, "plan", &o->plan, sizeof o->plan);
    keep_since(o, 2, STATE_SURFACE, &o->surface, sizeof o->surface);
}

struct optimiser *optimiser_new(const struct optimiser_input *input, bool derivatives,
                                const struct optimiser_method *method, void *self) {
    const struct settings *set = input->pace->settings;
    struct optimiser *o = mem_alloc(sizeof *o);
    *o = (struct optimiser){.in = *input, .settings = set, .hooks = input->pace->hooks, .method = method, .self = self};
    o->iteration_limit = (uint64_t)settings_number(set, "iterations");
    o->surface = hash_surface(&input->surface);
    const struct path_settings path = {
        .max_depth = (int)settings_number(set, "max_depth"),
        .roulette_depth = (int)settings_number(set, "roulette_depth"),
        .derivatives = derivatives,
        .seed = (uint64_t)settings_number(set, "seed"),
        .min_color = derivatives ? PATH_MIN_COLOR : 0.0f,
    };
    pass_init(&o->pass, &input->surface, input->world, input->views, set, &path, input->pool);
    emission_init(&o->emission, input->materials);
    keep_common(o);
    return o;
}

void optimiser_free(struct optimiser *o) {
    o->method->free(o->self);
    emission_release(&o->emission);
    pass_release(&o->pass);
    mem_free(o);
}

/* Observations so far. */
static double observation_count(const struct optimiser *o) {
    return (double)o->counters.path_count / settings_number(o->settings, "samples_per_camera");
}

/* Observations of an iteration, at most. */
static double visits_per_iteration(const struct optimiser *o) {
    return (double)o->pass.strata.stratum_count * settings_number(o->settings, "cameras_per_texel");
}

/* Planned iterations, or else observations; infinite where only the time limit ends them. */
static double wanted(const struct optimiser *o) {
    return o->iteration_limit ? (double)o->iteration_limit
                              : pace_observations_wanted(o->in.pace, o->in.surface.inverse);
}

/* Part of the run that is done, in [0, 1]; depends on the clock only where there is a time limit. */
static double fraction_done(const struct optimiser *o) {
    const struct plan_work *work = &o->in.pace->plan->part[PLAN_REFINE];
    double iteration = (double)o->counters.iteration, fraction;
    if (o->iteration_limit)
        fraction = iteration / (double)o->iteration_limit;
    else if (isinf(work->wanted))
        fraction = 0.0;
    else
        fraction = fmax(observation_count(o), iteration * visits_per_iteration(o) / MAX_VISITS) / wanted(o);
    if (isinf(work->wanted) || plan_is_cut(o->in.pace->plan, PLAN_REFINE))
        fraction = fmax(fraction, work->now > work->done ? work->done / work->now : 1.0);
    return fraction < 1.0 ? fraction : 1.0;
}

/* Plans an iteration limit as observations, by the mean number of an iteration so far. */
static void plan_iterations(struct optimiser *o) {
    double iteration = (double)o->counters.iteration;
    double done = observation_count(o);
    double each = iteration > 0.0 && done > 0.0 ? done / iteration : visits_per_iteration(o);
    if (o->iteration_limit)
        pace_plan_observations(o->in.pace, each * (double)o->iteration_limit);
}

float optimiser_rate_fall(double fraction) {
    double since = fmax(0.0, (fraction - OPTIMISER_FALL_FROM) / (1.0 - OPTIMISER_FALL_FROM));
    return (float)(1.0 / (1.0 + RATE_FALL * since));
}

enum status optimiser_save(struct optimiser *o, struct error *err) {
    plan_pass_time(o->in.pace->plan, o->hooks->worked_sec(o->hooks->user));
    o->counters.elapsed_sec = o->in.pace->plan->used_sec;
    for (int i = 0; i < PLAN_PARTS; i++) {
        o->plan.wanted[i] = o->in.pace->plan->part[i].wanted;
        o->plan.done[i] = o->in.pace->plan->part[i].done;
    }
    return o->hooks->checkpoint_save(o->hooks->user, (long)o->counters.iteration, o->state, o->state_count, err);
}

/* Rescales the curve's axis when a run was extended. */
static void redraw_curve(struct optimiser *o, bool is_extended) {
    struct optimiser_counters *c = &o->counters;
    double planned = wanted(o);
    for (size_t i = 0; is_extended && planned > c->planned && i < OPTIMISER_CURVE_POINTS; i++) {
        size_t bin = isinf(planned) ? 0 : (size_t)((double)i * c->planned / planned);
        double sum = c->curve_sum[i], count = c->curve_count[i];
        c->curve_sum[i] = c->curve_count[i] = 0.0;
        c->curve_sum[bin] += sum;
        c->curve_count[bin] += count;
    }
    c->planned = planned;
}

/* Restores the plan of earlier attempts. */
static void resume_plan(struct optimiser *o) {
    struct plan *plan = o->in.pace->plan;
    for (int i = PLAN_GATHER; i <= PLAN_DETAIL; i++) {
        plan_resume(plan, (enum plan_part)i, o->plan.done[i]);
        plan->part[i].wanted = o->plan.wanted[i];
        plan_close(plan, (enum plan_part)i);
    }
    plan_resume(plan, PLAN_REFINE, observation_count(o));
    /* A job whose time limit was raised after it had ended gets the difference of the limits. */
    bool is_extended = o->plan.ended_at_sec > 0.0 && plan->limit_sec > o->plan.ended_at_sec;
    plan->used_sec += is_extended ? fmax(o->counters.elapsed_sec, o->plan.ended_at_sec) : o->counters.elapsed_sec;
    o->plan.ended_at_sec = 0.0;
}

enum status optimiser_load(struct optimiser *o, bool *found, struct error *err) {
    enum status status = o->hooks->checkpoint_load(o->hooks->user, o->state, o->state_count, found, err);
    if (status != STATUS_OK)
        return status;
    /* The plan's first part always has work; without any the checkpoint is of format 1, whose curve is over seconds. */
    redraw_curve(o, *found && o->plan.wanted[0] > 0.0);
    if (!*found)
        return STATUS_OK;
    resume_plan(o);
    char line[128];
    snprintf(line, sizeof line, "resumed at iteration %llu", (unsigned long long)o->counters.iteration);
    o->hooks->log(o->hooks->user, line);
    o->method->resumed(o->self);
    return STATUS_OK;
}

/* One iteration; returns the mean loss of its observations. */
static double iterate(struct optimiser *o, double fraction) {
    struct optimiser_counters *c = &o->counters;
    /* First, since after a resume the lights do not match the materials yet. */
    world_update_lights(o->in.world);
    o->method->iterate(o->self, fraction);
    double loss = pass_mean_loss(&o->pass);
    size_t bin = (size_t)(fraction * (OPTIMISER_CURVE_POINTS - 1));
    c->curve_sum[bin] += loss;
    c->curve_count[bin] += 1.0;
    c->path_count += pass_observation_count(&o->pass) * (size_t)o->pass.batch[0].samples;
    c->iteration++;
    return loss;
}

/* Emits the metrics of an iteration. */
static void emit_metrics(const struct optimiser *o, double loss) {
    const struct reconstruct_hooks *hooks = o->hooks;
    long iteration = (long)o->counters.iteration;
    uint64_t rays, dropped;
    pass_ray_counts(&o->pass, &rays, &dropped);
    hooks->metric(hooks->user, "loss", iteration, loss);
    hooks->metric(hooks->user, "rays", iteration, (double)rays); /* of this attempt */
}

/* One iteration with its progress and metrics. */
static void advance(struct optimiser *o, double fraction) {
    double before = o->in.pace->plan->part[PLAN_REFINE].spent_sec;
    double loss = iterate(o, fraction);
    plan_iterations(o);
    pace_advance(o->in.pace, "refine", PLAN_REFINE, (double)pass_observation_count(&o->pass));
    o->counters.iterate_sec += o->in.pace->plan->part[PLAN_REFINE].spent_sec - before;
    emit_metrics(o, loss);
}

static enum status loop(struct optimiser *o, struct error *err) {
    const struct reconstruct_hooks *hooks = o->hooks;
    plan_iterations(o);
    if (isfinite(o->in.pace->plan->limit_sec))
        plan_fit(o->in.pace->plan);
    for (double fraction = fraction_done(o); fraction < 1.0; fraction = fraction_done(o)) {
        advance(o, fraction);
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
            enum status status = hooks->preview(hooks->user, o->in.previewed, err);
            if (status != STATUS_OK)
                return status;
        }
    }
    if (o->method->finish)
        o->method->finish(o->self);
    plan_close(o->in.pace->plan, PLAN_REFINE);
    o->plan.ended_at_sec = isfinite(o->in.pace->plan->limit_sec) ? o->in.pace->plan->limit_sec : 0.0;
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
    cJSON *figures = cJSON_AddObjectToObject(o->in.report, "refine");
    uint64_t rays, dropped;
    pass_ray_counts(&o->pass, &rays, &dropped);
    json_add_int(figures, "iterations", (int64_t)c->iteration);
    json_add_int(figures, "paths", (int64_t)c->path_count);
    json_add_int(figures, "rays_this_attempt", (int64_t)rays);
    json_add_int(figures, "non_finite_samples_dropped_this_attempt", (int64_t)dropped);
    json_add_number(figures, "paths_per_second", c->iterate_sec > 0.0 ? (double)c->path_count / c->iterate_sec : 0.0);
    json_add_number(figures, "paths_per_texel", (double)c->path_count / (double)o->in.surface.inverse->valid_count);
    cJSON *series = cJSON_AddObjectToObject(o->in.report, "series");
    json_add(series, "loss", curve_points(c));
}

enum status optimiser_run(struct optimiser *o, struct error *err) {
    enum status status = loop(o, err);
    if (status == STATUS_OK)
        report(o);
    return status;
}
