/* specular_misfit.c -- see specular_misfit.h. */
#include "server/material/specular_misfit.h"

#include <math.h>

#include "common/image.h"
#include "common/mem.h"

/* What the model is expected to miss: parts of the texel's radiance and of the room's median. With noise, the scale of
 * the robust residual (weight 1/4 at one scale). */
#define SCALE_RELATIVE 0.12f /* +25 %: 0 dB, roughness -0.22, specular -0.28 */
#define SCALE_MEDIAN 0.005f  /* +25 %: 0 dB */
/* Upper bound of base colour in the fit. Above 1 because incident light may be underestimated: with a bound of 1 white
 * surfaces would be explained by highlights that do not exist. */
#define MAX_BASE_COLOR 1.25f /* +25 %: +0.04 dB, roughness +0.05 */
#define SWEEPS 4
#define LEAST 1e-20f    /* of what is divided by */
#define CHANNELS 3      /* red, green, blue */
#define MAX_SCALES 1e3f /* bound of a residual, whose robust misfit is 1 by then: what half precision holds */
/* Regions along the greatest extent of a segment. With 5, 8 and 16 specular comes out at 17.6, 16.7 and 13.9 dB for
 * staircase2's phone (means by area; 9.8 without regions), at 17.8, 17.9 and 17.9 dB for the perfect bathroom. */
#define REGIONS_A_SIDE 8
#define REGION_COUNT (REGIONS_A_SIDE * REGIONS_A_SIDE * REGIONS_A_SIDE)

/* --- one point ---------------------------------------------------------------------------------- */

/* Sums over the channels, by observations. */
struct channel_sums {
    float misfit[SPECULAR_VIEWS], residual[SPECULAR_VIEWS];
};

static float mean_of_channel(const struct specular_sample *s, int channel) {
    float mean = 0.0f;
    for (size_t i = 0; i < s->count; i++)
        mean += (&s->view[i].observed.r)[channel] / (float)s->count;
    return mean;
}

static float model_variance(float mean, float median) {
    float scale = SCALE_RELATIVE * mean + SCALE_MEDIAN * median;
    return scale * scale;
}

/* Adds one channel under roughness k and specular m, with the base colour that fits the views of a sample best
 * (iteratively reweighted least squares; Geman and McClure's function). */
static void add_channel(const struct specular_sample *s, const struct specular_prediction *prediction, size_t k,
                        size_t m, int channel, float median, struct channel_sums *sums) {
    float diffuse[SPECULAR_VIEWS], unit_diffuse[SPECULAR_VIEWS], weight[SPECULAR_VIEWS], e[SPECULAR_VIEWS];
    float variance[SPECULAR_VIEWS], model = model_variance(mean_of_channel(s, channel), median);
    for (size_t i = 0; i < s->count; i++) {
        const struct specular_prediction *p = &prediction[i];
        float highlight = m == 0 ? 0.0f : (&p->highlight.radiance[k][m - 1].r)[channel];
        float noise = (&s->view[i].deviation.r)[channel];
        diffuse[i] = (&s->view[i].observed.r)[channel] - highlight;
        unit_diffuse[i] = (&p->unit_diffuse[k].r)[channel];
        variance[i] = fmaxf(model + noise * noise, LEAST);
        weight[i] = 1.0f / variance[i];
    }
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        float over = 0.0f, under = LEAST;
        for (size_t i = 0; i < s->count; i++) {
            over += weight[i] * unit_diffuse[i] * diffuse[i];
            under += weight[i] * unit_diffuse[i] * unit_diffuse[i];
        }
        float base = clampf(over / under, 0.0f, MAX_BASE_COLOR);
        for (size_t i = 0; i < s->count; i++) {
            e[i] = clampf((diffuse[i] - base * unit_diffuse[i]) / sqrtf(variance[i]), -MAX_SCALES, MAX_SCALES);
            float influence = 1.0f / (1.0f + e[i] * e[i]);
            weight[i] = influence * influence / variance[i];
        }
    }
    for (size_t i = 0; i < s->count; i++) {
        sums->misfit[i] += e[i] * e[i] / (1.0f + e[i] * e[i]);
        sums->residual[i] += e[i];
    }
}

void specular_misfit_find(const struct specular_sample *sample, const struct specular_prediction *prediction,
                          float median, specular_residuals *residual) {
    for (size_t k = 0; k < HIGHLIGHT_ROUGHNESSES; k++) {
        for (size_t m = 0; m < SPECULAR_LEVELS; m++) {
            struct channel_sums sums = {{0.0f}, {0.0f}};
            for (int c = 0; c < CHANNELS; c++)
                add_channel(sample, prediction, k, m, c, median, &sums);
            for (size_t i = 0; i < sample->count; i++)
                residual[i][k][m] = (struct specular_residual){image_half_from_float(sums.misfit[i]),
                                                               image_half_from_float(sums.residual[i] / CHANNELS)};
        }
    }
}

/* --- a segment ---------------------------------------------------------------------------------- */

static const struct specular_residual *residual_at(const struct specular_points *points, size_t observation,
                                                   struct specular_candidate_levels c) {
    return &points->residual[observation][c.k][c.m];
}

double specular_misfit_sum(const struct specular_points *points, struct specular_candidate_levels c) {
    double sum = 0.0;
    for (size_t i = 0, at = 0; i < points->count; i++)
        for (size_t v = 0; v < points->sample[i].count; v++)
            sum += (double)image_float_from_half(residual_at(points, at++, c)->misfit);
    return sum;
}

static double rho(double e) { return e * e / (1.0 + e * e); }

/* By how much the error of an observation raises the gain of b over a. */
static double error_effect(const struct specular_residual *a, const struct specular_residual *b) {
    double ea = (double)image_float_from_half(a->mean), eb = (double)image_float_from_half(b->mean);
    double without = fabs(eb) < fabs(ea) ? rho(ea - eb) : -rho(ea - eb);
    return CHANNELS * (rho(ea) - rho(eb) - without);
}

/* A sum over all observations that share an error. */
struct cluster {
    double sum, count;
};

static void cluster_add(struct cluster *cluster, double sum, double count) {
    cluster->sum += sum;
    cluster->count += count;
}

/* Of the whole sum, by how the clusters' sums deviate from `mean` for each observation; 0 where there is one only. */
static double clusters_variance(const struct cluster *cluster, size_t count, double mean) {
    double squares = 0.0, used = 0.0;
    for (size_t i = 0; i < count; i++) {
        double d = cluster[i].sum - mean * cluster[i].count;
        squares += d * d;
        used += cluster[i].count > 0.0;
    }
    return used > 1.0 ? squares * used / (used - 1.0) : 0.0;
}

/* Cubes over the extent of the points. */
struct region_grid {
    vec3 low;
    float side_m;
};

static struct region_grid grid_of(const struct specular_points *points) {
    vec3 low = points->sample[0].position, high = low;
    for (size_t i = 1; i < points->count; i++) {
        vec3 p = points->sample[i].position;
        low = (vec3){fminf(low.x, p.x), fminf(low.y, p.y), fminf(low.z, p.z)};
        high = (vec3){fmaxf(high.x, p.x), fmaxf(high.y, p.y), fmaxf(high.z, p.z)};
    }
    vec3 extent = vec3_sub(high, low);
    return (struct region_grid){low, fmaxf(extent.x, fmaxf(extent.y, extent.z)) / REGIONS_A_SIDE};
}

static size_t step_of(float along, float side_m) {
    size_t step = side_m > 0.0f ? (size_t)(along / side_m) : 0;
    return step < REGIONS_A_SIDE ? step : REGIONS_A_SIDE - 1;
}

static size_t region_of(const struct region_grid *r, vec3 p) {
    vec3 d = vec3_sub(p, r->low);
    return (step_of(d.x, r->side_m) * REGIONS_A_SIDE + step_of(d.y, r->side_m)) * REGIONS_A_SIDE +
           step_of(d.z, r->side_m);
}

/* Part of an observation's variance that is not noise. */
static double model_part(const struct specular_sample *s, size_t view, float median) {
    double model = 0.0, noise = 0.0;
    for (int c = 0; c < CHANNELS; c++) {
        double deviation = (double)(&s->view[view].deviation.r)[c];
        model += (double)model_variance(mean_of_channel(s, c), median);
        noise += deviation * deviation;
    }
    return model > 0.0 ? model / (model + noise) : 1.0;
}

/* Sums over the observations. */
struct gain_sums {
    double total, beyond_noise;          /* misfit of a; what noise does not explain of it */
    double gain, gain_squares;           /* gain; squares of the gains of points */
    double count, effects;               /* observations, effects of errors */
    double squares;                      /* of the effects on observations */
    struct cluster *point, *photograph;  /* [points->count], [photograph_count] effects; owned */
    size_t photograph_count;             /* greatest number of one, plus 1 */
    struct cluster region[REGION_COUNT]; /* likewise */
};

static void add_point(const struct specular_points *points, size_t i, size_t first, size_t region,
                      struct specular_candidate_levels a, struct specular_candidate_levels b, struct gain_sums *sums) {
    double gain = 0.0, count = (double)points->sample[i].count;
    for (size_t v = 0; v < points->sample[i].count; v++) {
        const struct specular_residual *residual_a = residual_at(points, first + v, a),
                                       *residual_b = residual_at(points, first + v, b);
        double without = (double)image_float_from_half(residual_a->misfit),
               effect = error_effect(residual_a, residual_b);
        gain += without - (double)image_float_from_half(residual_b->misfit);
        cluster_add(&sums->point[i], effect, 1.0);
        cluster_add(&sums->photograph[points->sample[i].view[v].train], effect, 1.0);
        sums->total += without;
        sums->beyond_noise += without * model_part(&points->sample[i], v, points->median);
        sums->squares += effect * effect;
    }
    cluster_add(&sums->region[region], sums->point[i].sum, count);
    sums->count += count;
    sums->effects += sums->point[i].sum;
    sums->gain += gain;
    sums->gain_squares += gain * gain;
}

/* What shared errors add to the variance of the gain over the points. */
static double shared_variance(const struct gain_sums *sums, size_t points) {
    double mean = sums->effects / sums->count;
    double of_observations = sums->squares - mean * sums->effects;
    double of_points = clusters_variance(sums->point, points, mean);
    double of_photographs = clusters_variance(sums->photograph, sums->photograph_count, mean);
    double of_regions = clusters_variance(sums->region, REGION_COUNT, mean);
    return fmax(of_photographs - of_observations, 0.0) + fmax(of_regions - of_points, 0.0);
}

static size_t photographs_end(const struct specular_points *points) {
    size_t end = 0;
    for (size_t i = 0; i < points->count; i++)
        for (size_t v = 0; v < points->sample[i].count; v++)
            end = points->sample[i].view[v].train >= end ? points->sample[i].view[v].train + 1 : end;
    return end;
}

struct specular_gain specular_misfit_gain(const struct specular_points *points, struct specular_candidate_levels a,
                                          struct specular_candidate_levels b) {
    struct gain_sums sums = {.photograph_count = photographs_end(points)};
    struct region_grid grid = grid_of(points);
    sums.point = mem_calloc(points->count, sizeof *sums.point);
    sums.photograph = mem_calloc(sums.photograph_count, sizeof *sums.photograph);
    for (size_t i = 0, at = 0; i < points->count; at += points->sample[i++].count)
        add_point(points, i, at, region_of(&grid, points->sample[i].position), a, b, &sums);
    double floor = points->floor * sums.beyond_noise;
    double variance = sums.gain_squares - sums.gain * sums.gain / (double)points->count + floor * floor +
                      shared_variance(&sums, points->count);
    mem_free(sums.photograph);
    mem_free(sums.point);
    return (struct specular_gain){sums.gain / fmax(sums.total, 1e-30), sums.gain / sqrt(fmax(variance, 1e-30))};
}
