/* lambert_mean.c -- see lambert_mean.h. */
#include "server/light/decision/lambert_mean.h"

static void add(double sum[4], rgb lambert) {
    sum[0] += (double)lambert.r;
    sum[1] += (double)lambert.g;
    sum[2] += (double)lambert.b;
    sum[3] += 1.0;
}

void lambert_mean_add(struct lambert_mean *m, const struct emitter_evidence *evidence, rgb observed, rgb lambert) {
    add(m->all, lambert);
    if (evidence_is_as_bright(evidence, observed))
        add(m->bright, lambert);
}

bool lambert_mean_of(const struct lambert_mean *m, rgb *mean) {
    const double *sum = m->bright[3] > 0.0 ? m->bright : m->all;
    if (sum[3] > 0.0)
        *mean = rgb_make((float)(sum[0] / sum[3]), (float)(sum[1] / sum[3]), (float)(sum[2] / sum[3]));
    return sum[3] > 0.0;
}
