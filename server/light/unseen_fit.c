/* unseen_fit.c -- see unseen_fit.h. */
#include "server/light/unseen_fit.h"

#include <math.h>
#include <string.h>

#include "common/cholesky.h"
#include "common/mem.h"
#include "common/quantile.h"
#include "server/light/light_priors.h"

#define CELLS SKY_CELLS
/* Least share of a point's rays in unseen directions for it to count in the fit. */
#define MIN_SHARE 0.1f
/* The share of the points whose base colour is at most that of white paint. In scans it is not near 1: in creases of a
 * fused mesh too little light is found. */
#define BELOW_WHITE 0.9
/* Deviations from its segment at which a point has a quarter of its influence. */
#define OUTLIER 2.0
/* Weight, as a share of the points at one deviation, of a difference of neighbouring cells by a factor of e. */
#define SMOOTHNESS 0.01
#define STEPS 40
#define LONGEST_STEP 0.5 /* of a logarithm */
#define FAINTEST 1e-12   /* in place of no light */

struct fit {
    const struct unseen_point *point; /* [count] */
    size_t count, segment_count;
    double *cell; /* [CELLS] the logarithm of the map */
};

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
static void scale_to_white(struct fit *f) {
    double low = -20.0, high = 20.0, cell[CELLS];
    for (int i = 0; i < 40; i++) {
        double middle = 0.5 * (low + high);
        for (size_t k = 0; k < CELLS; k++)
            cell[k] = f->cell[k] + middle;
        *(unseen_base_color(f->point, f->count, BELOW_WHITE, cell) > ALBEDO_WHITE ? &low : &high) = middle;
    }
    for (size_t k = 0; k < CELLS; k++)
        f->cell[k] += high;
}

/* Geman and McClure's weight of a residual in deviations. */
static double robust_weight(double deviations) {
    double e = deviations / OUTLIER, w = 1.0 / (1.0 + e * e);
    return w * w;
}

/* The mean of the logarithm of base colour in each segment. */
static void means_of_segments(const struct fit *f, const double *log_base, double *mean) {
    size_t segments = f->segment_count, *count = mem_calloc(segments, sizeof *count);
    memset(mean, 0, segments * sizeof *mean);
    for (size_t i = 0; i < f->count; i++) {
        mean[f->point[i].segment] += log_base[i];
        count[f->point[i].segment]++;
    }
    for (size_t s = 0; s < segments; s++)
        mean[s] /= fmax((double)count[s], 1.0);
    mem_free(count);
}

struct normal {
    double matrix[CELLS][CELLS], residual[CELLS];
};

/* Smooths: pulls the difference of two cells to zero. */
static void pull(struct normal *n, const double cell[CELLS], size_t a, size_t b, double weight) {
    double difference = cell[a] - cell[b];
    n->matrix[a][a] += weight;
    n->matrix[b][b] += weight;
    n->matrix[a][b] -= weight;
    n->matrix[b][a] -= weight;
    n->residual[a] -= weight * difference;
    n->residual[b] += weight * difference;
}

static void add_point(struct normal *n, const struct unseen_point *p, const double cell[CELLS], double log_base,
                      double mean) {
    const double beyond_weight = 1.0 / (ALBEDO_PATCH * ALBEDO_PATCH);
    double within = log_base - mean, beyond = fmax(log_base - log(ALBEDO_WHITE), 0.0);
    double within_weight = robust_weight(within / ALBEDO_WITHIN) / (ALBEDO_WITHIN * ALBEDO_WITHIN);
    double force = within_weight * within + beyond_weight * beyond;
    double weight = within_weight + (beyond > 0.0 ? beyond_weight : 0.0);
    double slope[CELLS], all = arrived(p, cell);
    for (size_t k = 0; k < CELLS; k++)
        slope[k] = (double)p->share[k] * exp(cell[k]) / all; /* of -log_base */
    for (size_t k = 0; k < CELLS; k++) {
        if (slope[k] == 0.0)
            continue;
        n->residual[k] += slope[k] * force;
        for (size_t m = 0; m < CELLS; m++)
            n->matrix[k][m] += weight * slope[k] * slope[m];
    }
}

static void step(struct fit *f, struct normal *n, double *log_base, double *mean) {
    double *cell = f->cell;
    const double smoothness = SMOOTHNESS * (double)f->count;
    memset(n, 0, sizeof *n);
    for (size_t i = 0; i < f->count; i++)
        log_base[i] = log(fmax((double)f->point[i].observed, FAINTEST) / arrived(&f->point[i], cell));
    means_of_segments(f, log_base, mean);
    for (size_t i = 0; i < f->count; i++)
        add_point(n, &f->point[i], cell, log_base[i], mean[f->point[i].segment]);
    for (size_t k = 0; k < CELLS; k++) {
        size_t right = sky_cells_right(k), below = sky_cells_below(k);
        pull(n, cell, k, right, smoothness);
        if (below < CELLS)
            pull(n, cell, k, below, smoothness);
    }
    if (!cholesky_factor(CELLS, CELLS, &n->matrix[0][0]))
        return;
    cholesky_solve(CELLS, CELLS, &n->matrix[0][0], n->residual);
    for (size_t k = 0; k < CELLS; k++)
        cell[k] += fmin(fmax(n->residual[k], -LONGEST_STEP), LONGEST_STEP);
}

void unseen_fit(const struct unseen_point *point, size_t count, size_t segment_count, double log_radiance[CELLS]) {
    struct fit f = {.point = point, .count = count, .segment_count = segment_count, .cell = log_radiance};
    double *log_base = mem_array(count, sizeof *log_base);
    double *mean = mem_array(segment_count, sizeof *mean);
    struct normal *n = mem_array(1, sizeof *n);
    memset(log_radiance, 0, CELLS * sizeof *log_radiance);
    scale_to_white(&f);
    for (int i = 0; i < STEPS; i++)
        step(&f, n, log_base, mean);
    scale_to_white(&f);
    mem_free(n);
    mem_free(mean);
    mem_free(log_base);
}
