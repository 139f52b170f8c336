/* joint_trial.c -- one source more in a joint fit; see joint_fit.h. */
#include <math.h>

#include "common/mem.h"
#include "server/light/joint_fit.h"

/* Values of a source that is tried: from one that adds this share of known light to what it lights, on average, octaves
 * apart; then nearer to the best. */
#define TRIED_FAINTEST 0.01
#define TRIED 18
#define TRIED_NEARER 4

static double square(double x) { return x * x; }

struct trial {
    const struct joint_fit *f;
    const float *column;
    double *light; /* [point_count] by all other sources */
    bool *reaches; /* [block_count] */
    struct joint_scratch scratch;
};

/* Loss over the blocks that the source reaches. */
static double loss_with(struct trial *t, double x) {
    const struct joint_fit *f = t->f;
    double loss = 0.0;
    for (size_t k = 0; k < f->block_count; k++) {
        const struct joint_block *b = &f->block[k];
        if (!t->reaches[k])
            continue;
        for (size_t i = b->first; i < b->end; i++)
            t->scratch.base[i - b->first] =
                log((double)f->point[i].observed / (t->light[i] + x * (double)t->column[i]));
        loss += joint_settle(f, b, &t->scratch);
    }
    return loss;
}

static double faintest(const struct trial *t) {
    double light = 0.0, response = 0.0;
    for (size_t i = 0; i < t->f->point_count; i++) {
        light += t->column[i] > 0.0f ? t->light[i] : 0.0;
        response += (double)t->column[i];
    }
    return response > 0.0 ? TRIED_FAINTEST * light / response : 0.0;
}

static double search(struct trial *t, struct joint_source *source) {
    double before = loss_with(t, 0.0), least = before, best = -INFINITY, step = log(2.0);
    double first = log(fmax(faintest(t), 1e-30));
    for (int i = 0; i < TRIED + 2 * TRIED_NEARER; i++) {
        if (i >= TRIED && i % 2 == TRIED % 2)
            step *= 0.5;
        double near = i % 2 == TRIED % 2 ? source->value - step : source->value + step;
        double theta = fmax(i < TRIED ? first + i * step : near, source->least);
        double here = loss_with(t, exp(theta)) + 0.5 * square((theta - source->mean) / source->deviation);
        if (here < least)
            least = here, best = theta, source->value = theta;
        if (i == TRIED - 1 && best == -INFINITY)
            return 0.0;
    }
    return before - least;
}

double joint_fit_try(const struct joint_fit *f, struct joint_source *source, const float *column) {
    struct trial t = {.f = f, .column = column, .light = mem_array(f->point_count + 1, sizeof *t.light)};
    double *x = joint_fit_radiances(f);
    bool reaches = false;
    t.reaches = mem_calloc(f->block_count + 1, sizeof *t.reaches);
    joint_scratch_init(&t.scratch, f);
    for (size_t k = 0; k < f->block_count; k++) {
        for (size_t i = f->block[k].first; i < f->block[k].end; i++) {
            t.light[i] = joint_fit_light(f, i, x);
            t.reaches[k] = t.reaches[k] || column[i] > 0.0f;
        }
        reaches = reaches || t.reaches[k];
    }
    double gain = reaches ? search(&t, source) : 0.0;
    joint_scratch_release(&t.scratch);
    mem_free(t.reaches);
    mem_free(x);
    mem_free(t.light);
    return gain;
}
