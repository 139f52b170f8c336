/* bound_color.c -- see bound_color.h. */
#include "server/material/bound_color.h"

#include <math.h>

#include "common/image.h"
#include "common/mem.h"
#include "common/vec.h"

/* Base colours of paint. */
#define BLACK 0.02
#define WHITE 0.85
/* Part of a segment that is unlike the rest of it: a stain, another thing's paint. */
#define UNLIKE 0.1
/* Relative error of light between two places of a segment. */
#define LIGHT_DEVIATION 0.1
#define STEPS 32 /* of the integral over base colour */

/* The measured texels of a segment, and the number of those that are bounded. */
struct known {
    double sum[3], squares[3], count, bounded;
};

static struct known *find_known(const struct surface *s, const struct measurement *measured) {
    struct known *known = mem_calloc(s->segments->count, sizeof *known);
    for (size_t i = 0; i < s->inverse->valid_count; i++) {
        uint32_t texel = s->inverse->valid[i];
        struct known *k = &known[surface_segment(s, texel)];
        if (!(measured[texel].weight > 0.0f))
            continue;
        if (measured[texel].bounds != 0) {
            k->bounded += 1.0;
            continue;
        }
        rgb value = rgb_clamp(measurement_value(&measured[texel]), 0.0f, 1.0f);
        for (int c = 0; c < 3; c++) {
            double x = (double)(&value.r)[c];
            k->sum[c] += x;
            k->squares[c] += x * x;
        }
        k->count += 1.0;
    }
    return known;
}

/* Expectation of a channel of base colour, and its variance. */
struct expected {
    double mean, variance;
};

static struct expected above(const struct known *k, int channel, double bound) {
    double like = (1.0 - UNLIKE) * k->count / (k->count + k->bounded);
    double mean = k->sum[channel] / fmax(k->count, 1.0), error = LIGHT_DEVIATION * mean;
    double variance = fmax(k->squares[channel] / fmax(k->count, 1.0) - mean * mean, 0.0) + error * error;
    double step = (WHITE - bound) / STEPS, sum = 0.0, first = 0.0, second = 0.0;
    variance = fmax(variance, step * step); /* what the steps can resolve */
    for (int i = 0; i < STEPS; i++) {
        double x = bound + (i + 0.5) * step, off = x - mean;
        double density = like * exp(-0.5 * off * off / variance) / sqrt(2.0 * M_PI * variance) +
                         (1.0 - like) / (x * log(WHITE / BLACK));
        sum += density;
        first += density * x;
        second += density * x * x;
    }
    first /= sum;
    return (struct expected){first, second / sum - first * first};
}

static void settle(const struct known *k, struct measurement *m) {
    rgb value = measurement_value(m);
    double variance = 0.0;
    for (int c = 0; c < 3; c++) {
        float *x = &(&value.r)[c];
        if (!(m->bounds >> c & 1) || *x >= (float)WHITE)
            continue;
        struct expected e = above(k, c, fmax((double)*x, BLACK));
        *x = (float)e.mean;
        variance += e.variance;
    }
    rgb_to_half(m->value, value);
    m->mixing = image_half_from_float(image_float_from_half(m->mixing) + (float)variance);
}

void bound_color_settle(const struct surface *s, struct measurement *measured) {
    struct known *known = find_known(s, measured);
    for (size_t i = 0; i < s->inverse->valid_count; i++) {
        uint32_t texel = s->inverse->valid[i];
        if (measured[texel].weight > 0.0f && measured[texel].bounds != 0)
            settle(&known[surface_segment(s, texel)], &measured[texel]);
    }
    mem_free(known);
}
