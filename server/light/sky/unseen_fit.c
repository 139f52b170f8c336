/* unseen_fit.c -- see unseen_fit.h. */
#include "server/light/sky/unseen_fit.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "server/light/joint_fit.h"

#define CELLS SKY_CELLS
/* Least share of a point's rays in unseen directions for it to count in the fit. */
#define MIN_SHARE 0.1f
/* The share of the points whose base colour is at most that of white paint. In scans it is not near 1: in creases of a
 * fused mesh too little light is found. */
#define BELOW_WHITE 0.9
#define FAINTEST 1e-12 /* in place of no light */

void unseen_add_ray(struct unseen_point *p, vec3 direction, float share, float filled) {
    struct sky_corners c = sky_cells_around(direction);
    p->filled += share * filled;
    p->unseen += share;
    for (int k = 0; k < 4; k++)
        p->share[c.cell[k]] += share * c.weight[k];
}

size_t unseen_keep_informative(struct unseen_point *point, size_t count) {
    size_t kept = 0;
    for (size_t i = 0; i < count; i++) {
        if (point[i].unseen >= MIN_SHARE)
            point[kept++] = point[i];
    }
    return kept;
}

double unseen_share(const struct unseen_point *point, size_t count) {
    double sum = 0.0;
    for (size_t i = 0; i < count; i++)
        sum += (double)point[i].unseen;
    return sum / fmax((double)count, 1.0);
}

static double arrived(const struct unseen_point *p, const double log_radiance[CELLS]) {
    double sum = (double)p->known;
    for (size_t k = 0; k < CELLS; k++)
        sum += (double)p->share[k] * exp(log_radiance[k]);
    return fmax(sum, FAINTEST);
}

double unseen_base_color(const struct unseen_point *point, size_t count, double below, const double *log_radiance) {
    float *base = mem_array(count + 1, sizeof *base);
    for (size_t i = 0; i < count; i++) {
        const struct unseen_point *p = &point[i];
        double light = log_radiance ? arrived(p, log_radiance) : (double)(p->known + p->filled);
        base[i] = (float)((double)p->observed / fmax(light, FAINTEST));
    }
    double found = (double)quantile(base, count, below);
    mem_free(base);
    return found;
}

/* Scales the map so that BELOW_WHITE of the base colours are at most that of white paint. */
static void scale_to_white(const struct unseen_point *point, size_t count, double log_radiance[CELLS]) {
    double low = -20.0, high = 20.0, cell[CELLS];
    for (int i = 0; i < 40; i++) {
        double middle = 0.5 * (low + high);
        for (size_t k = 0; k < CELLS; k++)
            cell[k] = log_radiance[k] + middle;
        *(unseen_base_color(point, count, BELOW_WHITE, cell) > ALBEDO_WHITE ? &low : &high) = middle;
    }
    for (size_t k = 0; k < CELLS; k++)
        log_radiance[k] += high;
}

static int by_segment(const void *a, const void *b) {
    const struct unseen_point *first = a, *second = b;
    if (first->segment != second->segment)
        return first->segment < second->segment ? -1 : 1;
    return memcmp(first, second, sizeof *first);
}

/* The cells as sources of a joint fit, in which each point is a patch. */
static void fit_cells(const struct unseen_point *point, size_t count, struct parallel *pool,
                      double log_radiance[CELLS]) {
    struct joint_point *joint = mem_array(count + 1, sizeof *joint);
    float *column = mem_array(count + 1, sizeof *column);
    struct joint_fit fit;
    for (size_t i = 0; i < count; i++)
        joint[i] = (struct joint_point){point[i].segment,
                                        (uint32_t)i,
                                        fmaxf(point[i].observed, (float)FAINTEST),
                                        fmaxf(point[i].known, (float)FAINTEST),
                                        0.0f,
                                        false,
                                        false};
    joint_fit_init(&fit, joint, count, 1 + CELLS, pool);
    for (size_t k = 0; k < CELLS; k++) {
        double even = log_radiance[k];
        for (size_t i = 0; i < count; i++)
            column[i] = point[i].share[k];
        const struct joint_source cell = {
            .mean = even, .deviation = LIGHT_UNKNOWN_DEVIATION, .least = -INFINITY, .value = even};
        joint_fit_add(&fit, &cell, column);
    }
    joint_fit_solve(&fit);
    for (size_t k = 0; k < CELLS; k++)
        log_radiance[k] = fit.source[1 + k].value;
    joint_fit_release(&fit);
    mem_free(column);
    mem_free(joint);
}

void unseen_fit(struct unseen_point *point, size_t count, struct parallel *pool, double log_radiance[CELLS]) {
    memset(log_radiance, 0, CELLS * sizeof *log_radiance);
    qsort(point, count, sizeof *point, by_segment);
    scale_to_white(point, count, log_radiance);
    fit_cells(point, count, pool, log_radiance);
    scale_to_white(point, count, log_radiance);
}
