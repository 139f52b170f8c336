/* light_finish.c -- see light_finish.h. */
#include "server/light/light_finish.h"

#include <math.h>

#include "common/mem.h"
#include "server/light/light_priors.h"

/* Fits a channel of the lamps, whose means are known; the unseen sky is grey. */
static void fit_channel(struct light_model *m, int channel) {
    struct joint_point *joint = mem_array(m->points.count + 1, sizeof *joint);
    struct joint_fit fit;
    for (size_t i = 0; i < m->points.count; i++) {
        const struct light_point *p = &m->points.point[i];
        float known = (&p->known.r)[channel];
        for (size_t k = 0; k < light_sky_cells(&m->sky) && m->has_sky && p->sky; k++)
            known += p->sky[k] * (float)exp(m->fit.source[m->first_cell + k].value);
        for (size_t k = 0; k < LIGHT_REGIONS && p->unobserved; k++)
            known += p->unobserved[3 * k + (size_t)channel] * (float)exp(m->fit.source[m->first_region + k].value);
        joint[i] = (struct joint_point){p->segment,  p->patch,  (&p->observed.r)[channel], known, m->joint[i].deviation,
                                        p->is_bound, p->is_lamp};
    }
    joint_fit_init(&fit, joint, m->points.count, 1 + m->lamps.count, m->r->pool);
    for (size_t i = 0; i < m->lamps.count; i++) {
        const struct light_lamp *lamp = &m->lamps.lamp[i];
        double least = log(fmax((double)(&lamp->least.r)[channel], 1e-30)), mean = m->fit.source[lamp->source].value;
        struct joint_source source = {.mean = mean, .deviation = COLOR_DEVIATION, .least = least, .value = mean};
        if (lamp->kind == ESTIMATED_HIDDEN || lamp->kind == ESTIMATED_OPENING) {
            source.least = -INFINITY;
        } else if (lamp->kind == ESTIMATED_SEEN) {
            double off = m->fit.source[lamp->source].value - m->fit.source[lamp->source].mean;
            source = (struct joint_source){
                .mean = least + off, .deviation = MEASURED_DEVIATION, .least = -INFINITY, .value = least + off};
        } else if (lamp->is_measured[channel]) {
            source.mean = least, source.value = least, source.deviation = MEASURED_DEVIATION;
        }
        source.value = fmax(source.value, source.least);
        joint_fit_add(&fit, &source, lamp->column);
    }
    joint_fit_solve(&fit);
    for (size_t i = 0; i < m->lamps.count; i++)
        (&m->lamps.lamp[i].radiance.r)[channel] = (float)exp(fit.source[1 + i].value);
    joint_fit_release(&fit);
    mem_free(joint);
}

void light_finish(struct light_model *m) {
    light_model_find_errors(m);
    double all = m->fit.light_error * m->fit.light_error;
    for (size_t i = 0; i < m->lamps.count; i++) {
        struct light_lamp *lamp = &m->lamps.lamp[i];
        const struct joint_source *source = &m->fit.source[lamp->source];
        double systematic = lamp->kind == ESTIMATED_SEEN ? 0.0 : source->share * SYSTEMATIC_DEVIATION;
        lamp->deviation = (float)hypot(source->error, SYSTEMATIC_DEVIATION);
        all += systematic * systematic;
    }
    m->r->light.deviation = (float)sqrt(all);
    for (int c = 0; c < 3 && m->lamps.count > 0; c++)
        fit_channel(m, c);
}
