/* refine.c -- see refine.h. */
#include "server/refine/refine.h"

#include <math.h>

#include "common/mem.h"
#include "server/refine/correction.h"
#include "server/refine/match.h"

/* Cells of the correction that lie across the texture. */
#define CELLS_ACROSS 128
/* Base colour moves when there are so many times the looks of the last time. */
#define LOOKS_GROW 1.25

/* What a look tells of base colour. */
struct look_match {
    uint32_t texel;
    float trust;
    struct match match;
};

struct refine {
    struct optimiser *o; /* borrowed: its owner */
    struct correction correction;
    double next_looks;        /* base colour moves when there are so many */
    struct look_match *look;  /* [chunk_count][look_capacity] of the last pass */
    double (*d_emission)[3];  /* [segment_count] */
    float emission_rate;
};

/* Keeps what each look of a chunk tells, to be taken in order when all are done. */
static void note_looks(void *self, size_t chunk, struct look_batch *b) {
    struct refine *f = self;
    for (size_t k = 0; k < b->look_count; k++) {
        const struct look *look = &b->look[k];
        size_t first = k * (size_t)b->samples;
        rgb expected = correction_expected(&f->correction, look->texel);
        rgb noise = noise_deviation(&f->o->r->noise, f->o->views, &look->view, expected);
        f->look[chunk * b->look_capacity + k] = (struct look_match){
            look->texel, look->trust,
            match_look(b->reference + first, b->radiance + first, b->samples, expected, noise,
                       f->o->views->median_radiance)};
    }
}

static void add_looks(struct refine *f) {
    const struct pass *pass = &f->o->pass;
    for (size_t c = 0; c < pass->chunk_count; c++) {
        const struct look_match *look = &f->look[c * pass->look_capacity];
        for (size_t k = 0; k < pass->chunk[c].look_count; k++) {
            uint32_t segment = f->o->r->segments.of_triangle[f->o->r->inverse.triangle[look[k].texel]];
            correction_look(&f->correction, look[k].texel, &look[k].match,
                            look[k].trust * look[k].match.trust * emission_slowdown(&f->o->emission, segment));
        }
    }
}

static double look_count(const struct refine *f) {
    return (double)f->o->counters.path_count / settings_number(f->o->r->settings, "samples_per_camera");
}

static void iterate(void *self, double fraction) {
    struct refine *f = self;
    struct pass *pass = &f->o->pass;
    pass_run(pass, f->o->counters.iteration, note_looks, f);
    add_looks(f);
    double looks = look_count(f) + (double)pass_look_count(pass);
    if (looks >= f->next_looks) {
        correction_apply(&f->correction, f->o->r->pool);
        f->next_looks = LOOKS_GROW * looks;
    }
    pass_d_emission(pass, f->d_emission);
    emission_step(&f->o->emission, f->d_emission, optimiser_rate_fall(fraction) * f->emission_rate);
}

static void resumed(void *self) {
    struct refine *f = self;
    emission_fix(&f->o->emission, f->o->r->is_emitter);
    correction_set_light(&f->correction, &f->o->r->fused);
}

static void finish(void *self) {
    struct refine *f = self;
    correction_apply(&f->correction, f->o->r->pool);
}

static void release(void *self) {
    struct refine *f = self;
    correction_release(&f->correction);
    mem_free(f->look);
    mem_free(f->d_emission);
    mem_free(f);
}

/* Texels a side of what lies so many times across the texture. */
static uint32_t part_of(const struct texture *t, uint32_t across) {
    uint32_t side = t->width > t->height ? t->width : t->height;
    return side > across ? side / across : 1;
}

static const struct optimiser_method method = {iterate, resumed, finish, release};

struct optimiser *refine_new(struct reconstruction *r, const struct views *views,
                             const struct reconstruct_hooks *hooks) {
    struct refine *f = mem_alloc(sizeof *f);
    struct optimiser *o = optimiser_new(r, views, hooks, false, &method, f);
    *f = (struct refine){.o = o};
    correction_init(&f->correction, &r->materials.base_color, &r->inverse, r->atlas.chart_of_triangle,
                    part_of(&r->materials.base_color, CELLS_ACROSS));
    f->look = mem_calloc(o->pass.chunk_count * o->pass.look_capacity, sizeof *f->look);
    f->d_emission = mem_array(r->segments.count, sizeof *f->d_emission);
    f->emission_rate = (float)settings_number(r->settings, "emission_rate");
    optimiser_keep(o, "correction.sums", f->correction.sums, f->correction.count * sizeof *f->correction.sums);
    optimiser_keep(o, "correction.solved", f->correction.solved,
                   (size_t)r->inverse.width * r->inverse.height * sizeof *f->correction.solved);
    optimiser_keep(o, "correction.next_looks", &f->next_looks, sizeof f->next_looks);
    return o;
}

enum status refine_start(struct optimiser *o, struct error *err) {
    emission_fix(&o->emission, o->r->is_emitter);
    for (size_t s = 0; s < o->r->segments.count; s++)
        emission_set(&o->emission, s, o->r->materials.emission[s]);
    correction_start(&((struct refine *)o->self)->correction);
    correction_set_light(&((struct refine *)o->self)->correction, &o->r->fused);
    return optimiser_save(o, err);
}
