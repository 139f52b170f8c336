/* color.c -- see color.h. Matrices from chromaticities: SMPTE RP 177 (1993); Bradford's: Lam 1985, as in ICC.1:2022,
 * annex E. */
#include "common/color.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/image.h"
#include "common/mem.h"

const struct color_primaries color_rec709 = {{0.64, 0.33}, {0.30, 0.60}, {0.15, 0.06}, {0.3127, 0.3290}};
const struct color_primaries color_display_p3 = {{0.680, 0.320}, {0.265, 0.690}, {0.150, 0.060}, {0.3127, 0.3290}};
const struct color_primaries color_dci_p3 = {{0.680, 0.320}, {0.265, 0.690}, {0.150, 0.060}, {0.314, 0.351}};
const struct color_primaries color_rec2020 = {{0.708, 0.292}, {0.170, 0.797}, {0.131, 0.046}, {0.3127, 0.3290}};
static const struct color_primaries adobe_rgb = {{0.64, 0.33}, {0.21, 0.71}, {0.15, 0.06}, {0.3127, 0.3290}};
const struct color_primaries color_rec601_525 = {{0.630, 0.340}, {0.310, 0.595}, {0.155, 0.070}, {0.3127, 0.3290}};
const struct color_primaries color_rec601_625 = {{0.64, 0.33}, {0.29, 0.60}, {0.15, 0.06}, {0.3127, 0.3290}};

/* Tolerance for the identity: sRGB profiles have rounded matrices, and this changes no 8-bit value. */
#define SAME_MATRIX 2e-3
/* Values below are colours outside of Rec. 709, and not rounding errors. */
#define OUTSIDE (-1.0f / 512.0f)

#define PQ_WHITE 203.0 /* cd/m2 */

void color_init(struct color *color) { *color = (struct color){.is_srgb = true}; }

void color_release(struct color *color) {
    if (color->profile)
        color->profile_free(color->profile);
    mem_free(color->curve);
    color_init(color);
}

/* --- matrices ------------------------------------------------------------------------------ */

typedef double matrix3[3][3];

static void multiply(const matrix3 a, const matrix3 b, matrix3 out) {
    matrix3 product;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            product[i][j] = a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j];
    memcpy(out, product, sizeof product);
}

static bool invert(const matrix3 m, matrix3 out) {
    matrix3 cofactor;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
            cofactor[i][j] = m[i1][j1] * m[i2][j2] - m[i1][j2] * m[i2][j1];
        }
    double determinant = m[0][0] * cofactor[0][0] + m[0][1] * cofactor[0][1] + m[0][2] * cofactor[0][2];
    if (!(fabs(determinant) > 1e-9) || !isfinite(determinant))
        return false;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            out[i][j] = cofactor[j][i] / determinant;
    return true;
}

static void transform(const matrix3 m, const double in[3], double out[3]) {
    for (int i = 0; i < 3; i++)
        out[i] = m[i][0] * in[0] + m[i][1] * in[1] + m[i][2] * in[2];
}

/* X Y Z of Y = 1. */
static bool xyz_of(const double xy[2], double xyz[3]) {
    xyz[0] = xy[0] / xy[1];
    xyz[1] = 1.0;
    xyz[2] = (1.0 - xy[0] - xy[1]) / xy[1];
    return xy[1] > 0.0 && isfinite(xyz[0]) && isfinite(xyz[2]);
}

static bool xyz_from_primaries(const struct color_primaries *p, matrix3 out) {
    const double *xy[3] = {p->red, p->green, p->blue};
    matrix3 columns, inverse;
    double white[3], share[3];
    for (int j = 0; j < 3; j++) { /* blue's y may be 0 or below (ACES AP0): x, y, z as they are */
        columns[0][j] = xy[j][0];
        columns[1][j] = xy[j][1];
        columns[2][j] = 1.0 - xy[j][0] - xy[j][1];
    }
    if (!xyz_of(p->white, white) || !invert(columns, inverse))
        return false;
    transform(inverse, white, share);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            out[i][j] = columns[i][j] * share[j];
    return true;
}

/* Bradford's adaptation between two whites. */
static bool adapt(const double from_xy[2], const double to_xy[2], matrix3 out) {
    static const matrix3 bradford = {{0.8951, 0.2664, -0.1614}, {-0.7502, 1.7135, 0.0367}, {0.0389, -0.0685, 1.0296}};
    matrix3 inverse, scale = {{0}};
    double from[3], to[3], from_cone[3], to_cone[3];
    if (!xyz_of(from_xy, from) || !xyz_of(to_xy, to) || !invert(bradford, inverse))
        return false;
    transform(bradford, from, from_cone);
    transform(bradford, to, to_cone);
    for (int i = 0; i < 3; i++)
        scale[i][i] = to_cone[i] / from_cone[i];
    multiply(scale, bradford, out);
    multiply(inverse, out, out);
    return isfinite(scale[0][0] + scale[1][1] + scale[2][2]);
}

/* From X, Y, Z relative to `white`. */
static bool to_rec709(const matrix3 xyz, const double white[2], float matrix[3][3], bool *is_same) {
    matrix3 adapted, rec709, all;
    if (!adapt(white, color_rec709.white, adapted) || !xyz_from_primaries(&color_rec709, rec709) ||
        !invert(rec709, rec709))
        return false;
    multiply(adapted, xyz, all);
    multiply(rec709, all, all);
    *is_same = true;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            matrix[i][j] = (float)all[i][j];
            *is_same = *is_same && fabs(all[i][j] - (i == j)) < SAME_MATRIX;
        }
    return true;
}

bool color_matrix(const struct color_primaries *from, float matrix[3][3], bool *is_same) {
    matrix3 xyz;
    return xyz_from_primaries(from, xyz) && to_rec709(xyz, from->white, matrix, is_same);
}

void color_matrix_d50(const double xyz[3][3], float matrix[3][3], bool *is_same) {
    static const double d50[2] = {0.34570, 0.35854}; /* X 0.9642, Y 1, Z 0.8249: ICC.1:2022, 7.2.16 */
    to_rec709(xyz, d50, matrix, is_same);
}

/* --- curves -------------------------------------------------------------------------------- */

static double pq(double stored) {
    static const double m1 = 2610.0 / 16384.0, m2 = 2523.0 / 4096.0 * 128.0, c1 = 3424.0 / 4096.0,
                        c2 = 2413.0 / 4096.0 * 32.0, c3 = 2392.0 / 4096.0 * 32.0;
    double p = pow(stored, 1.0 / m2);
    return 10000.0 / PQ_WHITE * pow(fmax(p - c1, 0.0) / (c2 - c3 * p), 1.0 / m1);
}

static double hlg(double stored) {
    static const double a = 0.17883277, b = 0.28466892, c = 0.55991073;
    return stored <= 0.5 ? stored * stored / 3.0 : (exp((stored - c) / a) + b) / 12.0;
}

static double linear_of(enum color_transfer transfer, double gamma, double stored) {
    switch (transfer) {
    case COLOR_POWER: return pow(stored, gamma);
    case COLOR_REC709: return stored < 0.081 ? stored / 4.5 : pow((stored + 0.099) / 1.099, 1.0 / 0.45);
    case COLOR_PQ: return pq(stored);
    case COLOR_HLG: return hlg(stored);
    case COLOR_SRGB: break;
    }
    return (double)image_srgb_to_linear((float)stored);
}

void color_set(struct color *color, const char *name, const struct color_primaries *primaries,
               enum color_transfer transfer, double gamma, int bits) {
    bool is_same = false;
    color_release(color);
    if (!color_matrix(primaries, color->matrix, &is_same) || !(gamma > 0.05 && gamma < 20.0)) {
        snprintf(color->warning, sizeof color->warning, "the numbers of its colours (%s) cannot be", name);
        return;
    }
    if (is_same && transfer == COLOR_SRGB)
        return;
    color->is_srgb = false;
    snprintf(color->name, sizeof color->name, "%s", name);
    color->step_count = bits > 8 ? 65536 : 256;
    color->curve = mem_array(3 * (size_t)color->step_count, sizeof *color->curve);
    for (uint32_t i = 0; i < color->step_count; i++) {
        float value = (float)linear_of(transfer, gamma, (double)i / (double)(color->step_count - 1));
        for (size_t c = 0; c < 3; c++)
            color->curve[c * color->step_count + i] = value;
    }
}

void color_set_adobe_rgb(struct color *color, int bits) {
    color_set(color, "Adobe RGB", &adobe_rgb, COLOR_POWER, 563.0 / 256.0, bits);
}

/* --- pixels -------------------------------------------------------------------------------- */

static inline void multiply_pixel(const float m[3][3], const float in[3], float *pixel, size_t *outside) {
    float r = m[0][0] * in[0] + m[0][1] * in[1] + m[0][2] * in[2];
    float g = m[1][0] * in[0] + m[1][1] * in[1] + m[1][2] * in[2];
    float b = m[2][0] * in[0] + m[2][1] * in[1] + m[2][2] * in[2];
    pixel[0] = r;
    pixel[1] = g;
    pixel[2] = b;
    *outside += fminf(r, fminf(g, b)) < OUTSIDE;
}

void color_multiply(const float matrix[3][3], float ceiling, float *pixel, size_t stride, size_t count,
                    size_t *outside) {
    for (size_t i = 0; i < count; i++, pixel += stride) {
        int bounds = (pixel[0] >= ceiling) + (pixel[1] >= ceiling) + (pixel[2] >= ceiling);
        if (bounds == 0)
            multiply_pixel(matrix, (const float[3]){pixel[0], pixel[1], pixel[2]}, pixel, outside);
        else if (bounds < 3)
            pixel[0] = pixel[1] = pixel[2] = NAN;
    }
}

static void convert_by_profile(const struct color *color, float *pixel, size_t stride, size_t count, size_t *outside) {
    enum { BLOCK = 1024 };
    float block[BLOCK][3];
    for (size_t done = 0; done < count; done += BLOCK) {
        size_t some = count - done < BLOCK ? count - done : BLOCK;
        for (size_t i = 0; i < some; i++)
            memcpy(block[i], pixel + (done + i) * stride, sizeof block[i]);
        color->profile_convert(color->profile, block, some);
        for (size_t i = 0; i < some; i++) {
            memcpy(pixel + (done + i) * stride, block[i], sizeof block[i]);
            *outside += fminf(block[i][0], fminf(block[i][1], block[i][2])) < OUTSIDE;
        }
    }
}

void color_convert(const struct color *color, float *pixel, size_t stride, size_t count, size_t *outside) {
    if (color->profile) {
        convert_by_profile(color, pixel, stride, count, outside);
        return;
    }
    float last = (float)(color->step_count - 1);
    for (size_t i = 0; i < count; i++, pixel += stride) {
        float linear[3];
        for (size_t c = 0; c < 3; c++) {
            float stored = pixel[c] > 0.0f ? fminf(pixel[c], 1.0f) : 0.0f;
            linear[c] = color->curve[c * color->step_count + (size_t)(stored * last + 0.5f)];
        }
        multiply_pixel(color->matrix, linear, pixel, outside);
    }
}
