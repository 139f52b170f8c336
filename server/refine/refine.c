/* refine.c -- see refine.h. */
#include "server/refine/refine.h"

#include "common/mem.h"
#include "server/refine/comparison.h"
#include "server/refine/correction.h"

/* Cells of the correction along the longer side of the texture: 16 texels of 2048, twice a probe's block (solve.c), as
 * errors of light are no finer. */
#define CELLS_ACROSS 128 /* +25 %: -0.08 dB at 256 texels */
/* Growth of the number of observations from one correction of base colour to the next: each costs one solve of all
 * cells, ten of them for ten times the observations. */
#define OBSERVATIONS_GROWTH 1.25 /* +25 %: 0 dB */

/* The comparison of one observation. */
struct stored_comparison {
    uint32_t texel;
    float weight;
    struct comparison comparison;
};

struct refine {
    struct optimiser *o;       /* borrowed: its owner */
    const struct fused *fused; /* borrowed, both */
    const struct noise *noise;
    struct correction correction;
    double next_observations;              /* number of observations of the next correction */
    struct stored_comparison *observation; /* [chunk_count][observation_capacity] of the last pass */
    double (*d_emission)[3];               /* [segment_count] */
    float emission_rate;
};

/* Stores the comparisons of a chunk; they are added in order when the pass is done. */
static void store_comparisons(void *self, size_t chunk, struct observation_batch *b) {
    struct refine *f = self;
    for (size_t k = 0; k < b->observation_count; k++) {
        const struct observation *observation = &b->observation[k];
        size_t first = k * (size_t)b->samples;
        rgb expected = correction_expected(&f->correction, observation->texel);
        rgb noise = noise_deviation(f->noise, f->o->in.views, &observation->view, expected);
        f->observation[chunk * b->observation_capacity + k] =
            (struct stored_comparison){observation->texel, observation->weight,
                                       comparison_make(b->reference + first, b->radiance + first, b->samples, expected,
                                                       noise, f->o->in.views->median_radiance)};
    }
}

static void add_comparisons(struct refine *f) {
    const struct pass *pass = &f->o->pass;
    for (size_t c = 0; c < pass->chunk_count; c++) {
        const struct stored_comparison *observation = &f->observation[c * pass->observation_capacity];
        for (size_t k = 0; k < pass->chunk[c].observation_count; k++) {
            uint32_t segment = surface_segment(&f->o->in.surface, observation[k].texel);
            float weight = observation[k].weight * observation[k].comparison.weight;
            correction_add(&f->correction, observation[k].texel, &observation[k].comparison,
                           weight * emission_slowdown(&f->o->emission, segment));
        }
    }
}

static double observation_count(const struct refine *f) {
    return (double)f->o->counters.path_count / settings_number(f->o->settings, "samples_per_camera");
}

static void iterate(void *self, double fraction) {
    struct refine *f = self;
    struct pass *pass = &f->o->pass;
    pass_run(pass, f->o->counters.iteration, store_comparisons, f);
    add_comparisons(f);
    double observations = observation_count(f) + (double)pass_observation_count(pass);
    if (observations >= f->next_observations) {
        correction_apply(&f->correction, f->o->in.pool);
        f->next_observations = OBSERVATIONS_GROWTH * observations;
    }
    pass_d_emission(pass, f->d_emission);
    emission_step(&f->o->emission, f->d_emission, optimiser_rate_fall(fraction) * f->emission_rate);
}

static void resumed(void *self) {
    struct refine *f = self;
    emission_fix(&f->o->emission, f->o->in.is_emitter);
    correction_set_light(&f->correction, f->fused);
}

static void finish(void *self) {
    struct refine *f = self;
    correction_apply(&f->correction, f->o->in.pool);
}

static void release(void *self) {
    struct refine *f = self;
    correction_release(&f->correction);
    mem_free(f->observation);
    mem_free(f->d_emission);
    mem_free(f);
}

/* Side in texels of a block of which `across` fit along the longer side of the texture. */
static uint32_t part_of(const struct texture *t, uint32_t across) {
    uint32_t side = t->width > t->height ? t->width : t->height;
    return side > across ? side / across : 1;
}

static const struct optimiser_method method = {iterate, resumed, finish, release};

struct optimiser *refine_new(const struct optimiser_input *input, const struct fused *fused,
                             const struct noise *noise) {
    const struct surface *surface = &input->surface;
    struct texture *base_color = &input->materials->base_color;
    struct refine *f = mem_alloc(sizeof *f);
    struct optimiser *o = optimiser_new(input, false, &method, f);
    *f = (struct refine){.o = o, .fused = fused, .noise = noise};
    correction_init(&f->correction, base_color, surface->inverse, surface->atlas->chart_of_triangle,
                    part_of(base_color, CELLS_ACROSS));
    f->observation = mem_calloc(o->pass.chunk_count * o->pass.observation_capacity, sizeof *f->observation);
    f->d_emission = mem_array(surface->segments->count, sizeof *f->d_emission);
    f->emission_rate = (float)settings_number(o->settings, "emission_rate");
    optimiser_add_state(o, "correction.sums", f->correction.sums, f->correction.count * sizeof *f->correction.sums);
    optimiser_add_state(o, "correction.solved", f->correction.solved,
                        (size_t)base_color->width * base_color->height * sizeof *f->correction.solved);
    optimiser_add_state(o, "correction.next_looks", &f->next_observations, sizeof f->next_observations);
    return o;
}

enum status refine_start(struct optimiser *o, struct error *err) {
    struct refine *f = o->self;
    emission_fix(&o->emission, o->in.is_emitter);
    for (size_t s = 0; s < o->in.surface.segments->count; s++)
        emission_set(&o->emission, s, o->in.materials->emission[s]);
    correction_start(&f->correction);
    correction_set_light(&f->correction, f->fused);
    return optimiser_save(o, err);
}
