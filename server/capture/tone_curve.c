/* tone_curve.c -- see tone_curve.h. */
#include "server/capture/tone_curve.h"

#include <math.h>
#include <string.h>

#include "common/image.h"
#include "common/mem.h"

/* Log of the darkest stored value that is tabulated; darker ones are noise (VIEWS_NOISE_VALUE). */
#define DARKEST (-6.2)
#define STEP (-DARKEST / (TONE_NODES - 1))
/* Least slope of a curve: a shoulder that keeps a twentieth of the contrast tells nothing any more. */
#define MIN_SLOPE 0.05
#define MAX_SLOPE (1.0 / MIN_SLOPE)
/* Encoded values over which the basis is orthonormal, and their number. */
#define FIRST_ENCODED 0.08
#define LAST_ENCODED 0.98
#define ENCODED 64

/* --- the basis ------------------------------------------------------------------------------------------- */

/* From which the b_k are made: 1, s, u, u^2, u^3, of the encoded value u. */
#define RAW (TONE_TERMS + 1)

static void raw_at(double s, double raw[RAW]) {
    double u = (double)image_linear_to_srgb((float)exp(s));
    raw[0] = 1.0, raw[1] = s, raw[2] = u, raw[3] = u * u, raw[4] = u * u * u;
}

/* Orthonormal combinations of the raw functions, each of those up to its own (Gram and Schmidt). */
static void orthonormalise(double out[RAW][RAW]) {
    double raw[ENCODED][RAW], value[RAW][ENCODED];
    for (size_t i = 0; i < ENCODED; i++) {
        double u = FIRST_ENCODED + (LAST_ENCODED - FIRST_ENCODED) * (double)i / (ENCODED - 1);
        raw_at(log((double)image_srgb_to_linear((float)u)), raw[i]);
    }
    memset(out, 0, sizeof(double[RAW][RAW]));
    for (size_t k = 0; k < RAW; k++) {
        out[k][k] = 1.0;
        for (size_t i = 0; i < ENCODED; i++)
            value[k][i] = raw[i][k];
        for (size_t j = 0; j <= k; j++) { /* at j == k: its own length */
            double dot = 0.0;
            for (size_t i = 0; i < ENCODED; i++)
                dot += value[j][i] * value[k][i] / ENCODED;
            double by = j < k ? -dot : 1.0 / sqrt(dot) - 1.0;
            for (size_t i = 0; i < ENCODED; i++)
                value[k][i] += by * value[j][i];
            for (size_t i = 0; i < RAW; i++)
                out[k][i] += by * out[j][i];
        }
    }
}

/* --- tables ----------------------------------------------------------------------------------------------- */

static double node(size_t i) { return DARKEST + STEP * (double)i; }

void tone_table_init(struct tone_table *t) {
    double by[RAW][RAW], raw[RAW];
    orthonormalise(by);
    memset(t, 0, sizeof *t);
    for (size_t i = 0; i < TONE_NODES; i++) {
        raw_at(node(i), raw);
        for (size_t k = 0; k < TONE_TERMS; k++)
            for (size_t j = 0; j < RAW; j++)
                t->basis[i][k] += by[k + 1][j] * raw[j];
        t->straight[i] = node(i);
    }
}

bool tone_table_set(struct tone_table *t, const struct tone_curve *curve) {
    double straight[TONE_NODES];
    for (size_t i = 0; i < TONE_NODES; i++) {
        straight[i] = node(i);
        for (size_t k = 0; k < TONE_TERMS; k++)
            straight[i] += curve->term[k] * t->basis[i][k];
        double slope = i > 0 ? (straight[i] - straight[i - 1]) / STEP : 1.0;
        if (!(slope >= MIN_SLOPE && slope <= MAX_SLOPE))
            return false;
    }
    memcpy(t->straight, straight, sizeof straight);
    return true;
}

/* The node before s, and the part of the way to the next. */
static size_t before(double s, double *part) {
    double at = fmin(fmax((s - DARKEST) / STEP, 0.0), TONE_NODES - 1.0);
    size_t i = (size_t)at < TONE_NODES - 1 ? (size_t)at : TONE_NODES - 2;
    *part = at - (double)i;
    return i;
}

void tone_basis(const struct tone_table *t, double s, double basis[TONE_TERMS]) {
    double part;
    size_t i = before(s, &part);
    for (size_t k = 0; k < TONE_TERMS; k++)
        basis[k] = t->basis[i][k] + part * (t->basis[i + 1][k] - t->basis[i][k]);
}

double tone_straight(const struct tone_table *t, double s) {
    double part;
    size_t i = before(s, &part);
    return t->straight[i] + part * (t->straight[i + 1] - t->straight[i]) + (s - fmin(fmax(s, DARKEST), 0.0));
}

double tone_stored(const struct tone_table *t, double straight) {
    size_t low = 0, high = TONE_NODES - 1;
    if (straight <= t->straight[low])
        return DARKEST + straight - t->straight[low];
    if (straight >= t->straight[high])
        return straight - t->straight[high];
    while (high - low > 1) {
        size_t middle = (low + high) / 2;
        *(t->straight[middle] <= straight ? &low : &high) = middle;
    }
    return node(low) + STEP * (straight - t->straight[low]) / (t->straight[high] - t->straight[low]);
}

/* --- photographs ------------------------------------------------------------------------------------------ */

static float straighten(const struct tone_table *t, float value) {
    return value > 0.0f ? (float)exp(tone_straight(t, log((double)value))) : value;
}

#define HALVES 65536

void tone_straighten(const struct tone_table *t, struct scene *scene) {
    uint16_t *straight = mem_array(HALVES, sizeof *straight);
    for (uint32_t i = 0; i < HALVES; i++) {
        float value = image_float_from_half((uint16_t)i);
        straight[i] = isfinite(value) ? image_half_from_float(straighten(t, value)) : (uint16_t)i;
    }
    for (size_t p = 0; p < scene->photograph_count; p++) {
        struct photograph *photo = &scene->photograph[p];
        size_t width = photo->camera.width;
        if (photo->is_hdr || photo->is_straight)
            continue;
        for (size_t y = 0; y < photo->camera.height; y++) {
            photograph_use(photo, y * width, width);
            for (size_t x = y * width; x < (y + 1) * width; x++)
                for (int c = 0; c < 3; c++)
                    photo->pixel[x][c] = straight[photo->pixel[x][c]];
        }
        photo->clip = image_float_from_half(straight[image_half_from_float(photo->clip)]);
        photo->is_straight = true;
    }
    mem_free(straight);
}
