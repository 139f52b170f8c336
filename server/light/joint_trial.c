/* joint_trial.c -- one source more in a joint fit; see joint_fit.h. */
#include <math.h>

#include "common/mem.h"
#include "server/light/joint_fit.h"
#include "server/light/strength_search.h"

struct trial {
    const struct joint_fit *f;
    const struct joint_source *source;
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

/* With the source's prior, and not below its bound; where there is none of it, without both. */
static void losses(void *user, const double *strength, size_t count, double *loss) {
    struct trial *t = user;
    for (size_t i = 0; i < count; i++) {
        double theta = fmax(log(strength[i]), t->source->least);
        double off = (theta - t->source->mean) / t->source->deviation;
        loss[i] = strength[i] > 0.0 ? loss_with(t, exp(theta)) + 0.5 * off * off : loss_with(t, 0.0);
    }
}

double joint_fit_try(const struct joint_fit *f, struct joint_source *source, const float *column) {
    struct trial t = {.f = f, .source = source, .column = column};
    double *x = joint_fit_radiances(f), known = 0.0, response = 0.0, best;
    t.light = mem_array(f->point_count + 1, sizeof *t.light);
    t.reaches = mem_calloc(f->block_count + 1, sizeof *t.reaches);
    joint_scratch_init(&t.scratch, f);
    for (size_t k = 0; k < f->block_count; k++) {
        for (size_t i = f->block[k].first; i < f->block[k].end; i++) {
            t.light[i] = joint_fit_light(f, i, x);
            t.reaches[k] = t.reaches[k] || column[i] > 0.0f;
            known += column[i] > 0.0f ? t.light[i] : 0.0;
            response += (double)column[i];
        }
    }
    double gain = strength_search(known, response, losses, &t, &best);
    if (best > 0.0)
        source->value = fmax(log(best), source->least);
    joint_scratch_release(&t.scratch);
    mem_free(t.reaches);
    mem_free(x);
    mem_free(t.light);
    return gain;
}
