/* solve.c -- see solve.h. */
#include "server/reconstruct/solve.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/gather/probes.h"
#include "server/gather/probes_refine.h"
#include "server/gather/sun_caustics.h"
#include "server/light/emitters.h"
#include "server/light/light_estimate.h"
#include "server/light/sun/sun_refit.h"
#include "server/material/bound_color.h"
#include "server/material/detail.h"
#include "server/material/divide_outgoing.h"
#include "server/material/specular_fit.h"
#include "server/reconstruct/inputs.h"
#include "server/reconstruct/solve_emitters.h"
#include "server/state/pace.h"

/* The first pass finds outgoing radiance, the second specular lobes in that light, the last everything. The second is
 * skipped where most light is an estimate (r->sky_is_fitted), whose error exceeds its gain. */
enum { PASS_LIGHT, PASS_SPECULAR, PASS_ALL, PASSES };
/* Part of gather_samples that passes before the last use: twice the noise, in what is averaged over again. */
#define EARLY_PASS_PART 0.25
/* Factor of measure_stride in passes before the last, which only need outgoing radiance, and in the last where a time
 * limit is too short. */
#define COARSE_STRIDE 2
#define SLICE_PROBES 1024 /* work between two checks of stop_requested */
#define SLICE_TEXELS 65536

struct solve {
    struct reconstruction *r;
    const struct views *views;
    const struct pace *pace;
    const struct reconstruct_hooks *hooks;
    struct divide_outgoing outgoing; /* by the last pass; at first fused radiance; owned */
    struct light_field field;        /* of probes: rays continue from polished surfaces by their lobes */
    struct light_field isotropic;    /* of highlights: radiance is taken as equal in all directions */
    struct probes probes;
    struct sun_shadows shadows;
    struct divide divide;
    struct solve_emitters emitters;
    double texels_per_pixel; /* detail_texels_per_pixel */
    double mirrored_share;   /* part of all light that is sun reflected by polished surfaces */
    size_t samples;          /* directions of each probe in the newest pass */
    bool is_previewed;       /* a preview of the newest pass was made */
};

/* --- progress and stopping ---------------------------------------------------------------------- */

/* Makes a preview of the newest pass, when one is due. */
static enum status preview_if_due(struct solve *s, struct error *err) {
    if (s->is_previewed || !s->hooks->preview_due(s->hooks->user))
        return STATUS_OK;
    s->is_previewed = true;
    return s->hooks->preview(s->hooks->user, s->r, err);
}

/* Reports work as done; STATUS_CANCELLED when the run is to stop. */
static enum status advance(struct solve *s, enum plan_part part, double work, struct error *err) {
    pace_advance(s->pace, "solve", part, work);
    if (s->hooks->stop_requested(s->hooks->user))
        return error_set(err, STATUS_CANCELLED, "stopped while solving");
    return preview_if_due(s, err);
}

static bool is_skipped(const struct solve *s, int pass) {
    return pass == PASS_SPECULAR && (s->r->sky_is_fitted || settings_number(s->r->settings, "gloss_passes") < 2.0);
}

static double wanted_samples(const struct solve *s, int pass) {
    double samples = settings_number(s->r->settings, "gather_samples");
    return pass == PASS_ALL ? samples : ceil(samples * EARLY_PASS_PART);
}

/* Directions wanted from pass `first` on, with today's probes in it and more in each that follows. */
static double wanted_directions(const struct solve *s, int first) {
    double directions = 0.0, probes = (double)s->probes.count;
    for (int pass = first; pass < PASSES; pass++) {
        if (is_skipped(s, pass))
            continue;
        directions += probes * wanted_samples(s, pass);
        probes *= 1.0 + PROBES_REFINED_SHARE;
    }
    return directions;
}

/* Directions of a probe in pass `first`, as planned for it and those after it. */
static size_t planned_samples(const struct solve *s, int first) {
    const struct plan_work *work = &s->r->plan.part[PLAN_GATHER];
    double left = wanted_directions(s, first);
    if (!plan_is_cut(&s->r->plan, PLAN_GATHER))
        return (size_t)wanted_samples(s, first);
    double share = left > 0.0 ? (work->now - work->done) / left : 1.0;
    return (size_t)ceil(fmin(fmax(share, PACE_MIN_GATHER), 1.0) * wanted_samples(s, first));
}

static uint32_t stride_of(const struct solve *s, int pass) {
    uint32_t stride = (uint32_t)settings_number(s->r->settings, "measure_stride");
    return pass == PASS_ALL ? stride : COARSE_STRIDE * stride;
}

static bool finds_detail(const struct solve *s) {
    return stride_of(s, PASS_ALL) == 1 && s->divide.denoises && s->texels_per_pixel > 1.0 &&
           settings_number(s->r->settings, "detail_steps") > 0.0;
}

static void plan_work(struct solve *s) {
    double valid = (double)s->r->inverse.valid_count, early = 0.0;
    double last = (double)stride_of(s, PASS_ALL), coarse = (double)stride_of(s, PASS_LIGHT);
    for (int pass = 0; pass < PASS_ALL; pass++)
        early += is_skipped(s, pass) ? 0.0 : valid / (coarse * coarse);
    pace_plan_solve(s->pace, valid, wanted_directions(s, PASS_LIGHT), early, valid / (last * last),
                    finds_detail(s) ? settings_number(s->r->settings, "detail_steps") * valid : 0.0);
}

static enum status gather(struct solve *s, int pass, struct error *err) {
    const struct reconstruction *r = s->r;
    uint64_t seed = (uint64_t)settings_number(r->settings, "seed") + (uint64_t)pass;
    enum status status = STATUS_OK;
    s->samples = planned_samples(s, pass);
    for (size_t first = 0; first < s->probes.count && status == STATUS_OK; first += SLICE_PROBES) {
        size_t count = s->probes.count - first < SLICE_PROBES ? s->probes.count - first : SLICE_PROBES;
        probes_gather(&s->probes, &s->field, &r->scene->mesh, &r->atlas, &r->inverse, seed, s->samples, first, count,
                      r->pool);
        status = advance(s, PLAN_GATHER, (double)(count * s->samples), err);
    }
    return status;
}

/* Measures all texels; in the last pass one in COARSE_STRIDE squared once the plan has no time for more. */
static enum status divide_all(struct solve *s, int pass, struct error *err) {
    size_t valid = s->r->inverse.valid_count;
    enum status status = STATUS_OK;
    s->divide.stride = stride_of(s, pass);
    for (size_t first = 0; first < valid && status == STATUS_OK; first += SLICE_TEXELS) {
        size_t count = valid - first < SLICE_TEXELS ? valid - first : SLICE_TEXELS;
        if (pass == PASS_ALL && plan_is_cut(&s->r->plan, PLAN_MEASURE))
            s->divide.stride = COARSE_STRIDE * stride_of(s, PASS_ALL);
        divide_texels(&s->divide, s->r->inverse.valid + first, count);
        double stride = (double)s->divide.stride;
        status = advance(s, PLAN_MEASURE, (double)count / (stride * stride), err);
    }
    return status;
}

/* Deconvolves the measured base colours (detail.h). */
static enum status find_detail(struct solve *s, struct error *err) {
    const struct reconstruction *r = s->r;
    size_t texels = (size_t)r->atlas.width * r->atlas.height;
    int steps = (int)settings_number(r->settings, "detail_steps");
    struct detail detail;
    enum status status = detail_reserve(s->views, err);
    if (status != STATUS_OK)
        return status;
    uint16_t(*lambert)[3] = mem_calloc_large(texels, sizeof *lambert);
    divide_lambert_all(&s->divide, lambert);
    detail_init(&detail, &(struct detail_input){.surface = reconstruction_surface(r),
                                                .views = s->views,
                                                .noise = &r->noise,
                                                .is_emitter = r->is_emitter,
                                                .pool = r->pool,
                                                .lambert = (const uint16_t(*)[3])lambert,
                                                .measured = s->divide.measured});
    for (int i = 0; i < steps && status == STATUS_OK; i++) {
        detail_step(&detail);
        status = advance(s, PLAN_DETAIL, (double)r->inverse.valid_count, err);
    }
    detail_finish(&detail);
    detail_release(&detail);
    mem_free(lambert);
    return status;
}

/* --- the whole ----------------------------------------------------------------------------------- */

static void solve_init(struct solve *s, struct reconstruction *r, const struct views *views, const struct pace *pace) {
    size_t texels = (size_t)r->atlas.width * r->atlas.height;
    *s = (struct solve){.r = r, .views = views, .pace = pace, .hooks = pace->hooks, .is_previewed = true};
    s->outgoing = (struct divide_outgoing){mem_calloc_large(texels, sizeof *s->outgoing.total),
                                           mem_calloc_large(texels, sizeof *s->outgoing.unmirrored),
                                           mem_calloc(r->segments.count, sizeof *s->outgoing.lobe)};
    memcpy(s->outgoing.total, r->fused.radiance, texels * sizeof *s->outgoing.total);
    memcpy(s->outgoing.unmirrored, r->fused.radiance, texels * sizeof *s->outgoing.unmirrored);
    solve_emitters_init(&s->emitters, r, views, &s->divide);
    s->field = (struct light_field){&r->world, (const uint16_t(*)[3])s->outgoing.unmirrored, s->outgoing.lobe, NULL};
    s->isotropic = (struct light_field){&r->world, (const uint16_t(*)[3])s->outgoing.total, NULL, NULL};
    probes_init(&s->probes, probes_spacing(r->atlas.width > r->atlas.height ? r->atlas.width : r->atlas.height),
                &r->scene->mesh, &r->atlas, &r->inverse, &r->fused);
    const struct surface surface = reconstruction_surface(r);
    s->texels_per_pixel = detail_texels_per_pixel(&surface, views);
    sun_shadows_init(&s->shadows, &surface, &r->sun, r->world.accel, r->pool);
    s->divide = inputs_of_divide(r, views, &s->probes, &s->isotropic, &s->shadows);
    s->divide.denoises = settings_bool(r->settings, "denoise");
    s->divide.highlight_samples = divide_highlight_samples(s->texels_per_pixel);
    s->divide.scratch = mem_array((size_t)parallel_thread_count(r->pool), sizeof *s->divide.scratch);
    s->divide.measured = mem_calloc_large(texels, sizeof *s->divide.measured);
    s->divide.typical = mem_array(r->segments.count, sizeof *s->divide.typical);
    for (size_t i = 0; i < r->segments.count; i++) {
        s->divide.typical[i] = NEUTRAL_BASE_COLOR;
        r->materials.roughness[i] = 1.0f;
        r->materials.specular[i] = 0.0f;
    }
    plan_work(s);
}

static void solve_release(struct solve *s) {
    mem_free(s->divide.typical);
    mem_free(s->divide.measured);
    mem_free(s->divide.scratch);
    sun_shadows_release(&s->shadows);
    probes_release(&s->probes);
    solve_emitters_release(&s->emitters);
    mem_free(s->outgoing.lobe);
    mem_free(s->outgoing.unmirrored);
    mem_free(s->outgoing.total);
}

/* Refits hidden and saturated lamps to outgoing radiance of the last pass; to its diffuse part once lobes are known. */
static void refit_light(struct solve *s, int pass) {
    struct fused diffuse;
    if (pass == PASS_SPECULAR || is_skipped(s, PASS_SPECULAR)) {
        light_estimate_again(s->r, s->views, &s->field, NULL);
    } else if (light_is_estimated(s->r)) {
        divide_diffuse(&s->divide, &diffuse);
        light_estimate_again(s->r, s->views, &s->field, &diffuse);
        fused_release(&diffuse);
    }
}

/* The fits between gathering and measuring. */
static enum status fit(struct solve *s, int pass, struct error *err) {
    solve_emitters_decide(&s->emitters);
    if (pass != PASS_LIGHT) {
        specular_fit(&(struct specular_input){reconstruction_surface(s->r), &s->r->fused, s->views, &s->r->noise,
                                              &s->probes, &s->isotropic, &s->r->sun},
                     s->r->is_emitter, &s->r->materials, s->r->pool);
        s->divide.stride = 1;
        sun_refit(&s->divide, &s->r->sun);
        s->mirrored_share = sun_caustics_add(&s->probes, &s->r->sun, &s->r->world, &s->r->scene->mesh, &s->r->inverse,
                                             (uint64_t)settings_number(s->r->settings, "seed"), s->r->pool);
    }
    return advance(s, PLAN_FIT, 1.0 / (is_skipped(s, PASS_SPECULAR) ? PASSES - 1 : PASSES), err);
}

static enum status solve_pass(struct solve *s, int pass, struct error *err) {
    if (pass == PASS_LIGHT) {
        emitters_light_bright(s->r, s->views, s->r->evidence);
    } else {
        refit_light(s, pass);
        solve_emitters_light(&s->emitters);
        probes_refine(&s->probes, PROBES_REFINED_SHARE, &s->r->scene->mesh, &s->r->atlas, &s->r->inverse, &s->r->fused);
    }
    enum status status = gather(s, pass, err);
    if (status == STATUS_OK)
        status = fit(s, pass, err);
    if (status == STATUS_OK)
        status = divide_all(s, pass, err);
    if (status == STATUS_OK)
        bound_color_settle(&s->divide.surface, s->divide.measured);
    bool sharpens = s->divide.stride == 1 && finds_detail(s) && !plan_is_cut(&s->r->plan, PLAN_DETAIL);
    if (status == STATUS_OK && sharpens)
        status = find_detail(s, err);
    if (status != STATUS_OK)
        return status;
    divide_finish(&s->divide);
    divide_outgoing_find(&s->divide, &s->outgoing);
    s->r->has_materials = true;
    s->is_previewed = false;
    return preview_if_due(s, err);
}

/* Roughness and specular of each segment. */
static cJSON *segment_list(const struct reconstruction *r) {
    cJSON *list = cJSON_CreateArray();
    for (size_t i = 0; i < r->segments.count; i++) {
        cJSON *entry = cJSON_CreateObject();
        json_add_int(entry, "object_id", r->segments.id[i]);
        const char *name = segments_name(&r->segments, &r->scene->mesh, i);
        if (name)
            json_add_string(entry, "name", name);
        json_add_number(entry, "roughness", (double)r->materials.roughness[i]);
        json_add_number(entry, "specular", (double)r->materials.specular[i]);
        cJSON_AddItemToArray(list, entry);
    }
    return list;
}

static void report(const struct solve *s) {
    size_t known = 0;
    for (size_t i = 0; i < s->r->inverse.valid_count; i++)
        known += s->divide.measured[s->r->inverse.valid[i]].weight > 0.0f;
    cJSON *figures = cJSON_AddObjectToObject(s->r->report, "solve");
    json_add_int(figures, "passes", is_skipped(s, PASS_SPECULAR) ? PASSES - 1 : PASSES);
    json_add_int(figures, "probes", (int64_t)s->probes.count);
    json_add_int(figures, "probe_spacing_texels", (int64_t)s->probes.spacing);
    json_add_int(figures, "directions_a_probe", (int64_t)s->samples);
    json_add_number(figures, "mirrored_sun_share_of_light", s->mirrored_share);
    json_add(figures, "segments", segment_list(s->r));
    json_add_int(figures, "measured_one_texel_in", (int64_t)s->divide.stride * (int64_t)s->divide.stride);
    json_add_number(figures, "texels_measured", (double)known / (double)s->r->inverse.valid_count);
}

enum status solve_run(struct reconstruction *r, const struct views *views, const struct pace *pace, struct error *err) {
    struct solve s;
    enum status status = STATUS_OK;
    solve_init(&s, r, views, pace);
    emitters_observe(r, views, r->evidence);
    for (int pass = 0; pass < PASSES && status == STATUS_OK; pass++)
        status = is_skipped(&s, pass) ? STATUS_OK : solve_pass(&s, pass, err);
    if (status == STATUS_OK) {
        solve_emitters_finish(&s.emitters);
        report(&s);
    }
    solve_release(&s);
    for (int part = PLAN_GATHER; part <= PLAN_DETAIL; part++)
        plan_close(&r->plan, (enum plan_part)part);
    return status;
}
