/* refine.c -- see refine.h. */
#include "server/reconstruct/refine.h"

#include <math.h>

#include "common/mem.h"
#include "server/reconstruct/match.h"

/* Windows of base colour that lie across the texture. */
#define WINDOWS_ACROSS 64

/* What a look tells of base colour. */
struct look_match {
    uint32_t texel;
    float trust;
    struct match match;
};

struct refine {
    struct optimiser *o; /* borrowed: its owner */
    struct matcher matcher;
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
        rgb expected = fused_radiance(&f->o->r->fused, look->texel);
        rgb noise = noise_deviation(&f->o->r->noise, f->o->views, &look->view, expected);
        f->look[chunk * b->look_capacity + k] = (struct look_match){
            look->texel, look->trust,
            match_look(b->reference + first, b->radiance + first, b->samples, expected, rgb_mean(noise),
                       f->o->views->median_radiance)};
    }
}

static void match_windows(struct refine *f) {
    const struct pass *pass = &f->o->pass;
    for (size_t c = 0; c < pass->chunk_count; c++) {
        const struct look_match *look = &f->look[c * pass->look_capacity];
        for (size_t k = 0; k < pass->chunk[c].look_count; k++)
            matcher_step(&f->matcher, look[k].texel, &look[k].match, look[k].trust * look[k].match.trust);
    }
}

static void iterate(void *self, double fraction) {
    struct refine *f = self;
    struct pass *pass = &f->o->pass;
    pass_run(pass, f->o->counters.iteration, note_looks, f);
    match_windows(f);
    pass_d_emission(pass, f->d_emission);
    emission_step(&f->o->emission, f->d_emission, optimiser_rate_fall(fraction) * f->emission_rate);
}

static void resumed(void *self) {
    struct refine *f = self;
    emission_fix(&f->o->emission, f->o->r->is_emitter);
}

static void release(void *self) {
    struct refine *f = self;
    matcher_release(&f->matcher);
    mem_free(f->look);
    mem_free(f->d_emission);
    mem_free(f);
}

/* Part of the looks that windows are to have, in the mean. */
static double done(const void *self) {
    const struct refine *f = self;
    double wanted = settings_number(f->o->r->settings, "refine_looks");
    double windows = ceil(ldexp((double)f->o->r->inverse.valid_count, -2 * f->matcher.level));
    double looks = (double)f->o->counters.path_count / settings_number(f->o->r->settings, "samples_per_camera");
    return wanted > 0.0 ? looks / (wanted * windows) : 0.0;
}

static const struct optimiser_method method = {iterate, resumed, done, release};

/* Windows are 2^level texels a side. */
static int level_of(const struct texture *t) {
    int level = 0;
    while ((t->width > t->height ? t->width : t->height) >> (level + 1) >= WINDOWS_ACROSS)
        level++;
    return level;
}

struct optimiser *refine_new(struct reconstruction *r, const struct views *views,
                             const struct reconstruct_hooks *hooks) {
    struct refine *f = mem_alloc(sizeof *f);
    struct optimiser *o = optimiser_new(r, views, hooks, false, &method, f);
    *f = (struct refine){.o = o};
    matcher_init(&f->matcher, &r->materials.base_color, &r->inverse, &r->segments, r->atlas.chart_of_triangle,
                 &o->emission, level_of(&r->materials.base_color));
    f->look = mem_calloc(o->pass.chunk_count * o->pass.look_capacity, sizeof *f->look);
    f->d_emission = mem_array(r->segments.count, sizeof *f->d_emission);
    f->emission_rate = (float)settings_number(r->settings, "emission_rate");
    optimiser_keep(o, "base_color.moved", f->matcher.block, matcher_bytes(&f->matcher));
    return o;
}

enum status refine_start(struct optimiser *o, double seconds, struct error *err) {
    emission_fix(&o->emission, o->r->is_emitter);
    for (size_t s = 0; s < o->r->segments.count; s++)
        emission_set(&o->emission, s, o->r->materials.emission[s]);
    o->counters.elapsed_sec = seconds;
    return optimiser_save(o, err);
}
