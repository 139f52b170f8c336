/* patch_spectrum.c -- see patch_spectrum.h.
 *
 * In this file a plane's samples are those of one lattice, and `power` is the sum over channels, relative to the mean
 * variance of the patch. */
#include "server/material/patch_spectrum.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "common/mem.h"
#include "server/material/patch_transform.h"

/* Patches to each side over which power is averaged; 2: passage's specks .53 % for .43, else within .05 dB. */
#define AROUND 3
/* Power over that of noise from which it counts as texture, and what is taken off: split halves understate noise by 1.1
 * to 1.4 (plain walls of passage and staircase2), and power around has a sampling error of a fifth. 2 in place of 3:
 * passage's 8-bit walls have specks on 5 % of their pixels in place of .9. */
#define TEXTURE_POWER 3.0f
#define NOISE_TAKEN 1.5f
/* What is taken off an octave's power over that of its noise. */
#define OCTAVE_NOISE 2.0f
/* In variances of its noise: what a patch's power is clipped to, unless that leaves TEXTURE_POWER of texture around;
 * and from where it tells of texture by itself: 5.5 standard deviations of gray noise. 16 for 30: passage +-.05 dB, its
 * 8-bit walls' specks 2 % for .9. */
#define CLIPPED_POWER 9.0f
#define CERTAIN_POWER 30.0f

#define LEAST_SHAPE 0.01f /* of noise at a frequency that blocks lack, which is not all white otherwise */

/* Of a patch: what is hardly trusted has hardly any, but powers over it must not overflow. */
#define LEAST_VARIANCE 1e-12f

/* Power of noise by coefficient where that of blocks of samples is the same, up to a factor. */
struct noise_shape {
    float of[PATCH_SIZE], sum[PATCH_LENGTHS]; /* sums over the coefficients of a length */
};

/* Power of a block at a frequency, by that at 0: the square of Dirichlet's kernel. */
static float block_power(size_t block, int frequency) {
    double half = 0.5 * M_PI * frequency / PATCH_SIDE;
    double kernel = frequency == 0 ? 1.0 : sin((double)block * half) / ((double)block * sin(half));
    return (float)(kernel * kernel);
}

static void make_noise_shape(struct noise_shape *shape, const struct patch_basis *basis, size_t block) {
    *shape = (struct noise_shape){.sum = {0.0f}};
    for (int y = 0; y < PATCH_SIDE; y++)
        for (int x = 0; x < PATCH_SIDE; x++) {
            int at = y * PATCH_SIDE + x;
            shape->of[at] = fmaxf(block_power(block, x) * block_power(block, y), LEAST_SHAPE);
            shape->sum[basis->length[at]] += shape->of[at];
        }
}

/* One of the step x step lattices of samples, and the patches over it: patch (i, j) begins at sample ((i - 1)
 * PATCH_SHIFT, (j - 1) PATCH_SHIFT) of the lattice. */
struct lattice {
    const struct patch_spectrum *in;
    const struct patch_basis *basis;
    const struct noise_shape *shape;
    size_t first;                  /* its first sample */
    long width, height;            /* samples */
    long columns, rows;            /* patches */
    float *variance, *mixing;      /* [patches] means; variance is 0 of one without samples */
    float *patch_count;            /* [patches] of those around that have some */
    float (*noise)[PATCH_LENGTHS]; /* [patches] power of noise by length of frequency, over the shape; sums around */
    float (*value[3])[PATCH_SIZE]; /* [patches] by channel */
    float (*power)[PATCH_SIZE], (*around)[PATCH_SIZE], (*clipped)[PATCH_SIZE]; /* of that; sums around */
};

/* The part of a patch that lies on the picture. */
struct extent {
    long x0, y0, x1, y1; /* of the patch's samples */
    size_t origin;       /* where its first sample would be, in the plane: may wrap below 0, and is used with others */
};

static struct extent extent_of(const struct lattice *l, size_t patch) {
    long x = ((long)patch % l->columns - 1) * PATCH_SHIFT, y = ((long)patch / l->columns - 1) * PATCH_SHIFT;
    long step = (long)l->in->step;
    return (struct extent){x < 0 ? -x : 0, y < 0 ? -y : 0, x + PATCH_SIDE < l->width ? PATCH_SIDE : l->width - x,
                           y + PATCH_SIDE < l->height ? PATCH_SIDE : l->height - y,
                           l->first + (size_t)(step * (y * (long)l->in->width + x))};
}

static size_t sample_of(const struct lattice *l, const struct extent *e, long x, long y) {
    return e->origin + l->in->step * ((size_t)y * l->in->width + (size_t)x);
}

/* Reads a patch under its window, and transforms it. */
static void read_patch(const struct lattice *l, size_t patch, const float *plane, float to[PATCH_SIZE]) {
    struct extent e = extent_of(l, patch);
    memset(to, 0, sizeof(float) * PATCH_SIZE);
    for (long y = e.y0; y < e.y1; y++)
        for (long x = e.x0; x < e.x1; x++)
            to[y * PATCH_SIDE + x] = l->basis->window[y] * l->basis->window[x] * plane[sample_of(l, &e, x, y)];
    patch_transform(l->basis, to);
}

/* Adds the inverse of a patch's coefficients, under its window, to a plane. */
static void add_patch(const struct lattice *l, size_t patch, float of[PATCH_SIZE], float *plane) {
    struct extent e = extent_of(l, patch);
    patch_transform_back(l->basis, of);
    for (long y = e.y0; y < e.y1; y++)
        for (long x = e.x0; x < e.x1; x++)
            plane[sample_of(l, &e, x, y)] += l->basis->window[y] * l->basis->window[x] * of[y * PATCH_SIDE + x];
}

static float window_power(const struct lattice *l, long x, long y) {
    float w = l->basis->window[y] * l->basis->window[x];
    return w * w;
}

/* Means over the whole patch, of which missing samples have none. */
static void weigh_patch(struct lattice *l, size_t patch) {
    struct extent e = extent_of(l, patch);
    float variance = 0.0f, mixing = 0.0f;
    for (long y = e.y0; y < e.y1; y++)
        for (long x = e.x0; x < e.x1; x++) {
            size_t at = sample_of(l, &e, x, y);
            float trust = l->in->trust[at], w = window_power(l, x, y) * trust * trust;
            variance += w * l->in->variance[at];
            mixing += w * l->in->mixing[at];
        }
    l->variance[patch] = variance > 0.0f ? fmaxf(variance / (0.25f * PATCH_SIZE), LEAST_VARIANCE) : 0.0f;
    l->mixing[patch] = mixing / (0.25f * PATCH_SIZE);
}

/* Sums of vectors [patches][length] over the square of AROUND patches to each side; in place. */
static void sum_around(const struct lattice *l, float *vector, size_t length) {
    size_t most = (size_t)(l->columns > l->rows ? l->columns : l->rows);
    float *line = mem_array(most * length, sizeof *line);
    for (int axis = 0; axis < 2; axis++) {
        long count = axis == 0 ? l->columns : l->rows, lines = axis == 0 ? l->rows : l->columns;
        size_t next = axis == 0 ? length : (size_t)l->columns * length;
        size_t other = axis == 0 ? (size_t)l->columns * length : length;
        for (long j = 0; j < lines; j++) {
            float *first = vector + (size_t)j * other;
            for (long i = 0; i < count; i++)
                memcpy(line + (size_t)i * length, first + (size_t)i * next, length * sizeof *line);
            for (long i = 0; i < count; i++) {
                float *to = first + (size_t)i * next;
                memset(to, 0, length * sizeof *to);
                for (long q = i > AROUND ? i - AROUND : 0; q <= i + AROUND && q < count; q++)
                    for (size_t k = 0; k < length; k++)
                        to[k] += line[(size_t)q * length + k];
            }
        }
    }
    mem_free(line);
}

static size_t patches_of(const struct lattice *l) { return (size_t)(l->columns * l->rows); }

static void lattice_init(struct lattice *l, const struct patch_spectrum *in, const struct noise_shape *shape, size_t x,
                         size_t y) {
    *l = (struct lattice){.in = in,
                          .basis = patch_basis(),
                          .shape = shape,
                          .first = y * in->width + x,
                          .width = (long)((in->width - x + in->step - 1) / in->step),
                          .height = (long)((in->height - y + in->step - 1) / in->step)};
    l->columns = (l->width + PATCH_SHIFT - 1) / PATCH_SHIFT + 1;
    l->rows = (l->height + PATCH_SHIFT - 1) / PATCH_SHIFT + 1;
    size_t patches = patches_of(l);
    l->variance = mem_calloc(patches, sizeof *l->variance);
    l->mixing = mem_calloc(patches, sizeof *l->mixing);
    l->patch_count = mem_calloc(patches, sizeof *l->patch_count);
    l->noise = mem_calloc(patches, sizeof *l->noise);
    for (int c = 0; c < 3; c++)
        l->value[c] = mem_array(patches, sizeof *l->value[c]);
    l->power = mem_array(patches, sizeof *l->power);
    l->around = mem_array(patches, sizeof *l->around);
    l->clipped = mem_array(patches, sizeof *l->clipped);
}

static void lattice_release(struct lattice *l) {
    mem_free(l->variance);
    mem_free(l->mixing);
    mem_free(l->patch_count);
    mem_free(l->noise);
    for (int c = 0; c < 3; c++)
        mem_free(l->value[c]);
    mem_free(l->power);
    mem_free(l->around);
    mem_free(l->clipped);
}

static void measure_noise(struct lattice *l) {
    float patch[PATCH_SIZE];
    for (size_t i = 0; i < patches_of(l); i++) {
        weigh_patch(l, i);
        if (!(l->variance[i] > 0.0f))
            continue;
        l->patch_count[i] = 1.0f;
        for (int c = 0; c < 3; c++) {
            read_patch(l, i, l->in->noise[c], patch);
            for (int k = 0; k < PATCH_SIZE; k++) {
                int length = l->basis->length[k];
                l->noise[i][length] += patch[k] * patch[k] / l->variance[i] / l->shape->sum[length];
            }
        }
    }
    sum_around(l, l->noise[0], PATCH_LENGTHS);
    sum_around(l, l->patch_count, 1);
}

/* Of a coefficient, around. */
static float noise_of(const struct lattice *l, size_t patch, int coefficient) {
    return l->noise[patch][l->basis->length[coefficient]] * l->shape->of[coefficient];
}

/* Coefficients of the values, their power, and that around, also with each patch's clipped. */
static void measure_power(struct lattice *l) {
    size_t patches = patches_of(l);
    memset(l->power, 0, patches * sizeof *l->power);
    memset(l->clipped, 0, patches * sizeof *l->clipped);
    for (size_t i = 0; i < patches; i++) {
        if (!(l->variance[i] > 0.0f))
            continue;
        for (int c = 0; c < 3; c++) {
            float *value = l->value[c][i];
            read_patch(l, i, l->in->value[c], value);
            for (int k = 0; k < PATCH_SIZE; k++)
                l->power[i][k] += value[k] * value[k] / l->variance[i];
        }
        for (int k = 0; k < PATCH_SIZE; k++)
            l->clipped[i][k] = fminf(l->power[i][k], CLIPPED_POWER * noise_of(l, i, k) / l->patch_count[i]);
    }
    memcpy(l->around, l->power, patches * sizeof *l->around);
    sum_around(l, l->around[0], PATCH_SIZE);
    sum_around(l, l->clipped[0], PATCH_SIZE);
}

/* Of a coefficient's two. */
static int greater_frequency(int coefficient) {
    int y = coefficient / PATCH_SIDE, x = coefficient % PATCH_SIDE;
    return x > y ? x : y;
}

/* Power beyond noise of the coefficients of each octave, by their greater frequency, in the mean over them: of texture
 * that is no stronger in some than in others. */
static void octave_texture(const struct lattice *l, size_t patch, float texture[PATCH_SIDE]) {
    for (int first = 0; first < PATCH_SIDE; first = first == 0 ? 1 : 2 * first) {
        int end = first == 0 ? 1 : 2 * first;
        float power = 0.0f, noise = 0.0f;
        for (int k = 0; k < PATCH_SIZE; k++) {
            if (greater_frequency(k) < first || greater_frequency(k) >= end)
                continue;
            power += l->clipped[patch][k];
            noise += noise_of(l, patch, k);
        }
        for (int f = first; f < end; f++)
            texture[f] = noise > 0.0f ? fmaxf(power / noise - OCTAVE_NOISE, 0.0f) : 0.0f;
    }
}

/* What is kept of a patch's coefficients; returns the expected squared error of that. All powers are sums around but
 * for the patch's own. What neighbours share may be all in one coefficient of each octave. */
static float shares_of(const struct lattice *l, size_t patch, float keep[PATCH_SIZE]) {
    float count = l->patch_count[patch], error = 0.0f, octave[PATCH_SIDE];
    float mixing = l->mixing[patch] * count / l->variance[patch] * (0.25f * PATCH_SIZE);
    octave_texture(l, patch, octave);
    for (int k = 0; k < PATCH_SIZE; k++) {
        float noise = noise_of(l, patch, k), power = l->clipped[patch][k];
        if (power > TEXTURE_POWER * noise)
            power = l->around[patch][k];
        float texture = power > TEXTURE_POWER * noise ? power - NOISE_TAKEN * noise : 0.0f;
        texture = fmaxf(texture, octave[greater_frequency(k)] * noise);
        float own = l->power[patch][k] * count, all = noise + mixing / l->basis->octave_count[k];
        keep[k] = texture > 0.0f ? texture / (texture + all) : 0.0f;
        if (own > CERTAIN_POWER * all)
            keep[k] = fmaxf(keep[k], 1.0f - all / own);
        error += keep[k] * all / count * l->variance[patch];
    }
    return error;
}

/* Adds what is kept to kept[channel], and what that is off to `error`, which may be NULL. */
static void keep_texture(struct lattice *l, float *const kept[3], float *error) {
    float keep[PATCH_SIZE];
    for (size_t i = 0; i < patches_of(l); i++) {
        if (!(l->variance[i] > 0.0f))
            continue;
        float off = shares_of(l, i, keep) / (0.25f * PATCH_SIZE);
        for (int c = 0; c < 3; c++) {
            for (int k = 0; k < PATCH_SIZE; k++)
                l->value[c][i][k] *= keep[k];
            add_patch(l, i, l->value[c][i], kept[c]);
        }
        struct extent e = extent_of(l, i);
        for (long y = e.y0; error && y < e.y1; y++)
            for (long x = e.x0; x < e.x1; x++)
                error[sample_of(l, &e, x, y)] += window_power(l, x, y) * off;
    }
}

/* What is not trusted is taken from what was kept, which is cleared. */
static void fill_in(const struct lattice *l, float *const kept[3]) {
    for (long y = 0; y < l->height; y++)
        for (long x = 0; x < l->width; x++) {
            size_t at = l->first + l->in->step * ((size_t)y * l->in->width + (size_t)x);
            for (int c = 0; c < 3; c++) {
                l->in->value[c][at] += (1.0f - l->in->trust[at]) * kept[c][at];
                kept[c][at] = 0.0f;
            }
        }
}

static void filter_lattice(const struct patch_spectrum *p, const struct noise_shape *shape, size_t x, size_t y,
                           float *const kept[3]) {
    struct lattice l;
    lattice_init(&l, p, shape, x, y);
    measure_noise(&l);
    measure_power(&l);
    keep_texture(&l, kept, NULL);
    fill_in(&l, kept);
    measure_power(&l);
    keep_texture(&l, kept, p->error);
    lattice_release(&l);
}

void patch_spectrum_filter(struct patch_spectrum *p) {
    size_t samples = p->width * p->height;
    float *kept[3];
    struct noise_shape shape;
    make_noise_shape(&shape, patch_basis(), p->block > p->step ? p->block / p->step : 1);
    for (int c = 0; c < 3; c++) {
        kept[c] = mem_calloc(samples, sizeof *kept[c]);
        for (size_t i = 0; i < samples; i++) {
            p->value[c][i] *= p->trust[i];
            p->noise[c][i] *= p->trust[i];
        }
    }
    for (size_t y = 0; y < p->step && y < p->height; y++)
        for (size_t x = 0; x < p->step && x < p->width; x++)
            filter_lattice(p, &shape, x, y, kept);
    for (int c = 0; c < 3; c++) {
        memcpy(p->value[c], kept[c], samples * sizeof *kept[c]);
        mem_free(kept[c]);
    }
}
