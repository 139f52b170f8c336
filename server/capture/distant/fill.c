/* fill.c -- see fill.h. */
#include "server/capture/distant/fill.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "common/cholesky_band.h"
#include "common/mem.h"
#include "common/vec.h"
#include "server/scene/latlong.h"

/* Luminance that is propagated is clamped to this many times the typical one: sky and clouds differ by less, a lamp or
 * a sun is not to be spread over what is unknown. */
#define LUMINANCE_LIMIT 4.0 /* +25 %: no change */
#define DARKEST 1e-3        /* of it: values below count as so bright, since logarithms are propagated */
#define MOST_LOG 80.0f      /* e^88 is the greatest float; anything beyond the limits does */
#define SWEEPS 32           /* of Gauss-Seidel after pull-push: smooths its blocks over 32 pixels; +25 %: no change */
/* Weight of the pull of neighbouring rows to each other over that of a pixel: decides only where no row is known. */
#define ROWS_ALIKE 1e-3

/* Solid angle of a pixel, by its index. */
static double angle_of(const struct image *map, size_t pixel) {
    return latlong_pixel_angle(map->width, map->height, (uint32_t)(pixel / map->width));
}

/* Squared mean of square roots: robust to a sun. */
static double typical_luminance(const struct image *map, const bool *is_known) {
    double sum = 0.0, weight = 0.0;
    for (size_t i = 0; i < (size_t)map->width * map->height; i++) {
        const float *p = map->pixel + 3 * i;
        if (!is_known[i])
            continue;
        double angle = angle_of(map, i);
        sum += angle * sqrt((double)rgb_luminance(rgb_make(p[0], p[1], p[2])));
        weight += angle;
    }
    return (sum / weight) * (sum / weight);
}

/* A colour within the limits of what is propagated. */
static rgb within_limits(rgb color, double limit) {
    double luminance = (double)rgb_luminance(color);
    float scale = luminance > limit ? (float)(limit / luminance) : 1.0f, least = (float)(limit * DARKEST);
    return rgb_make(fmaxf(scale * color.r, least), fmaxf(scale * color.g, least), fmaxf(scale * color.b, least));
}

/* The logarithm of a known colour. */
static rgb log_color(const struct image *map, size_t pixel, double limit) {
    const float *p = map->pixel + 3 * pixel;
    rgb color = within_limits(rgb_make(p[0], p[1], p[2]), limit);
    return rgb_make(logf(color.r), logf(color.g), logf(color.b));
}

/* --- the profile -------------------------------------------------------------------------------------- */

/* The logarithm of the colour of each row, p: minimises, of logarithms of pixels,
 *
 *   sum over pairs of known pixels, one above the other in rows y and y + 1, of (p(y + 1) - p(y) - their difference)^2
 *   + 1 / height^2 sum over known pixels of (p(y) - pixel)^2 + a weak pull of neighbouring rows to each other
 *
 * Each row shows directions of its own, and sky is brighter on one side than on the other. The differences of rows
 * within the same columns tell how it changes with height; means only tell how bright it is on the whole. */
struct profile {
    size_t height;
    double (*matrix)[2]; /* [height] a row's entry to the left of the diagonal, and on it; owned */
    double *right;       /* [3][height] owned */
};

static void pull_to_each_other(struct profile *p, size_t row, double weight, const float *difference) {
    p->matrix[row][1] += weight;
    p->matrix[row + 1][0] -= weight;
    p->matrix[row + 1][1] += weight;
    for (size_t c = 0; c < 3; c++) {
        p->right[c * p->height + row] -= weight * (double)difference[c];
        p->right[c * p->height + row + 1] += weight * (double)difference[c];
    }
}

static void add_pixel(struct profile *p, const struct image *map, const bool *is_known, size_t i, double limit) {
    size_t row = i / map->width, below = i + map->width;
    double anchor = 1.0 / ((double)p->height * (double)p->height);
    if (!is_known[i])
        return;
    rgb color = log_color(map, i, limit);
    p->matrix[row][1] += anchor;
    for (size_t c = 0; c < 3; c++)
        p->right[c * p->height + row] += anchor * (double)(&color.r)[c];
    if (row + 1 < p->height && is_known[below]) {
        rgb differs = rgb_sub(log_color(map, below, limit), color);
        pull_to_each_other(p, row, 1.0, &differs.r);
    }
}

/* [height]; the caller's. */
static rgb *row_colors(const struct image *map, const bool *is_known, double limit) {
    struct profile p = {map->height, mem_calloc(map->height, sizeof *p.matrix),
                        mem_calloc(3 * (size_t)map->height, sizeof *p.right)};
    rgb *color = mem_array(map->height, sizeof *color);
    for (size_t i = 0; i < (size_t)map->width * map->height; i++)
        add_pixel(&p, map, is_known, i, limit);
    for (size_t y = 0; y + 1 < p.height; y++)
        pull_to_each_other(&p, y, ROWS_ALIKE / ((double)p.height * (double)p.height), (const float[3]){0});
    cholesky_band_factor(p.height, 1, &p.matrix[0][0]);
    for (size_t c = 0; c < 3; c++) {
        cholesky_band_solve(p.height, 1, &p.matrix[0][0], p.right + c * p.height);
        for (size_t y = 0; y < p.height; y++)
            (&color[y].r)[c] = (float)p.right[c * p.height + y];
    }
    mem_free(p.right);
    mem_free(p.matrix);
    return color;
}

/* --- pull-push and diffusion ------------------------------------------------------------------------ */

/* A pyramid level: difference from the row's colour, in logarithms, and confidence from 0 to 1. */
struct fill_level {
    uint32_t width, height;
    float (*value)[4]; /* [height][width]; owned */
    float *angle;      /* [height] solid angle of a cell of each row; owned */
};

static void start_finest(struct fill_level *l, const struct image *map, const bool *is_known, const rgb *row_color,
                         double limit) {
    *l = (struct fill_level){.width = map->width, .height = map->height};
    l->value = mem_calloc((size_t)l->width * l->height, sizeof *l->value);
    l->angle = mem_array(l->height, sizeof *l->angle);
    for (uint32_t y = 0; y < l->height; y++)
        l->angle[y] = (float)latlong_pixel_angle(l->width, l->height, y);
    for (size_t i = 0; i < (size_t)l->width * l->height; i++) {
        if (!is_known[i])
            continue;
        rgb differs = rgb_sub(log_color(map, i, limit), row_color[i / l->width]);
        for (int c = 0; c < 3; c++)
            l->value[i][c] = (&differs.r)[c];
        l->value[i][3] = 1.0f;
    }
}

/* Next coarser level: means by solid angle and confidence. One known pixel of four makes a known one. */
static void pull(const struct fill_level *fine, struct fill_level *coarse) {
    *coarse = (struct fill_level){.width = fine->width / 2, .height = fine->height / 2};
    coarse->value = mem_calloc((size_t)coarse->width * coarse->height, sizeof *coarse->value);
    coarse->angle = mem_array(coarse->height, sizeof *coarse->angle);
    for (uint32_t y = 0; y < coarse->height; y++) {
        coarse->angle[y] = 2.0f * (fine->angle[2 * y] + fine->angle[2 * y + 1]);
        for (uint32_t x = 0; x < coarse->width; x++) {
            float sum[3] = {0}, weight = 0.0f, all = 0.0f;
            for (uint32_t k = 0; k < 4; k++) {
                uint32_t row = 2 * y + k / 2;
                const float *v = fine->value[(size_t)row * fine->width + 2 * x + k % 2];
                float angle = fine->angle[row];
                for (int c = 0; c < 3; c++)
                    sum[c] += angle * v[3] * v[c];
                weight += angle * v[3];
                all += angle;
            }
            float *out = coarse->value[(size_t)y * coarse->width + x];
            for (int c = 0; c < 3 && weight > 0.0f; c++)
                out[c] = sum[c] / weight;
            out[3] = fminf(1.0f, 4.0f * weight / all);
        }
    }
}

/* Blends the interpolated coarser level into unknown pixels. */
static void push(const struct fill_level *coarse, struct fill_level *fine) {
    for (uint32_t y = 0; y < fine->height; y++) {
        float row = clampf(0.5f * ((float)y + 0.5f) - 0.5f, 0.0f, (float)(coarse->height - 1));
        uint32_t top = (uint32_t)row, low = top + 1 < coarse->height ? top + 1 : top;
        float fy = row - (float)top;
        for (uint32_t x = 0; x < fine->width; x++) {
            float *out = fine->value[(size_t)y * fine->width + x], trust = out[3];
            if (trust == 1.0f)
                continue;
            uint32_t left = (x / 2 + (x % 2 ? 0 : coarse->width - 1)) % coarse->width;
            uint32_t right = (left + 1) % coarse->width;
            float fx = x % 2 ? 0.25f : 0.75f;
            const float(*up)[4] = (const float(*)[4])coarse->value + (size_t)top * coarse->width;
            const float(*down)[4] = (const float(*)[4])coarse->value + (size_t)low * coarse->width;
            for (int c = 0; c < 3; c++) {
                float a = up[left][c] + fx * (up[right][c] - up[left][c]);
                float b = down[left][c] + fx * (down[right][c] - down[left][c]);
                out[c] = trust * out[c] + (1.0f - trust) * (a + fy * (b - a));
            }
        }
    }
}

/* One Gauss-Seidel sweep of the Laplace equation over the inner rows; known pixels are fixed. */
static void diffuse(struct fill_level *l) {
    uint32_t w = l->width;
    double step_x = 2.0 * PI / w, step_y = latlong_polar(l->height, 1.0);
    for (uint32_t y = 1; y + 1 < l->height; y++) {
        double sine = sin(latlong_polar(l->height, y));
        float up = (float)(sin(latlong_polar(l->height, y - 0.5)) * sine / (step_y * step_y));
        float down = (float)(sin(latlong_polar(l->height, y + 0.5)) * sine / (step_y * step_y));
        float side = (float)(1.0 / (step_x * step_x)), over = 1.0f / (up + down + 2.0f * side);
        float(*row)[4] = l->value + (size_t)y * w;
        for (uint32_t x = 0; x < w; x++) {
            if (row[x][3] == 1.0f)
                continue;
            const float *left = row[(x + w - 1) % w], *right = row[(x + 1) % w];
            for (int c = 0; c < 3; c++)
                row[x][c] = over * (up * row[(ptrdiff_t)x - (ptrdiff_t)w][c] + down * row[x + w][c] +
                                    side * (left[c] + right[c]));
        }
    }
}

/* A pole is one direction: it gets the mean of the adjacent row. */
static void join_pole(struct fill_level *l, uint32_t pole, uint32_t neighbour) {
    float(*row)[4] = l->value + (size_t)pole * l->width;
    double sum[3] = {0};
    for (uint32_t x = 0; x < l->width; x++)
        for (int c = 0; c < 3; c++)
            sum[c] += (double)l->value[(size_t)neighbour * l->width + x][c] / l->width;
    for (uint32_t x = 0; x < l->width && row[0][3] < 1.0f; x++)
        for (int c = 0; c < 3; c++)
            row[x][c] = (float)sum[c];
}

/* Two pixels: unknown ones get their mean. */
static void fill_coarsest(struct fill_level *l) {
    float(*v)[4] = l->value;
    float weight = v[0][3] + v[1][3];
    for (int c = 0; c < 3; c++) {
        float mean = (v[0][3] * v[0][c] + v[1][3] * v[1][c]) / weight;
        for (int i = 0; i < 2; i++)
            v[i][c] = v[i][3] * v[i][c] + (1.0f - v[i][3]) * mean;
    }
}

/* Where each row shows little, the ratios of rows add up to a profile without bounds: what is seen through the gaps of
 * a scan made a sky of 360,000 times the light that is seen, within limits it is as bright as what is seen. */
static void fill_pixel(struct image *map, size_t i, const float difference[4], rgb row, double limit) {
    rgb color = rgb_make(expf(fminf(difference[0] + row.r, MOST_LOG)), expf(fminf(difference[1] + row.g, MOST_LOG)),
                         expf(fminf(difference[2] + row.b, MOST_LOG)));
    color = within_limits(color, limit);
    memcpy(map->pixel + 3 * i, &color, 3 * sizeof(float));
}

void fill_sphere(struct image *map, const bool *is_known) {
    struct fill_level level[32];
    int count = 1;
    double limit = LUMINANCE_LIMIT * typical_luminance(map, is_known);
    rgb *row_color = row_colors(map, is_known, limit);
    start_finest(&level[0], map, is_known, row_color, limit);
    for (; level[count - 1].height > 1; count++)
        pull(&level[count - 1], &level[count]);
    fill_coarsest(&level[count - 1]);
    for (int i = count - 1; i > 0; i--)
        push(&level[i], &level[i - 1]);
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        join_pole(&level[0], 0, 1);
        join_pole(&level[0], map->height - 1, map->height - 2);
        diffuse(&level[0]);
    }
    for (size_t i = 0; i < (size_t)map->width * map->height; i++)
        if (level[0].value[i][3] < 1.0f)
            fill_pixel(map, i, level[0].value[i], row_color[i / map->width], limit);
    for (int i = 0; i < count; i++) {
        mem_free(level[i].value);
        mem_free(level[i].angle);
    }
    mem_free(row_color);
}

/* --- distance to the nearest known pixel ------------------------------------------------------------- */

#define UNKNOWN UINT32_MAX

/* Nearest known pixel of each pixel, propagated by neighbours (Danielsson 1980). */
struct nearest_known {
    uint32_t width, height;
    uint32_t *of; /* [height][width] index of the nearest known pixel, or UNKNOWN */
    vec2 *row;    /* [height] sine and cosine of the polar angle */
    vec2 *column; /* [width] of the azimuth */
};

static float cosine_between(const struct nearest_known *n, uint32_t a, uint32_t b) {
    vec2 row_a = n->row[a / n->width], row_b = n->row[b / n->width];
    vec2 column_a = n->column[a % n->width], column_b = n->column[b % n->width];
    float turn = column_a.x * column_b.x + column_a.y * column_b.y;
    return row_a.x * row_b.x * turn + row_a.y * row_b.y;
}

static void propagate(struct nearest_known *n, uint32_t from, uint32_t to) {
    uint32_t known = n->of[from];
    if (known != UNKNOWN && (n->of[to] == UNKNOWN || cosine_between(n, known, to) > cosine_between(n, n->of[to], to)))
        n->of[to] = known;
}

/* One row of a sweep: from the row before it, then along it in both directions. */
static void propagate_row(struct nearest_known *n, uint32_t y, uint32_t before) {
    uint32_t w = n->width, here = y * w, there = before * w;
    for (uint32_t x = 0; x < w && before != y; x++) {
        propagate(n, there + x, here + x);
        propagate(n, there + (x + 1) % w, here + x);
        propagate(n, there + (x + w - 1) % w, here + x);
    }
    for (uint32_t i = 0; i < 2 * w; i++) /* twice: across the seam */
        propagate(n, here + i % w, here + (i + 1) % w);
    for (uint32_t i = 2 * w; i > 0; i--)
        propagate(n, here + i % w, here + (i - 1) % w);
}

/* Radians to the nearest known pixel. */
static float angle_at(const struct nearest_known *n, uint32_t pixel) {
    uint32_t known = n->of[pixel];
    if (known == UNKNOWN)
        return INFINITY;
    return known == pixel ? 0.0f : acosf(clampf(cosine_between(n, known, pixel), -1.0f, 1.0f));
}

static void nearest_init(struct nearest_known *n, uint32_t width, uint32_t height, const bool *is_known) {
    size_t pixels = (size_t)width * height;
    *n = (struct nearest_known){width, height, mem_array(pixels, sizeof *n->of), mem_array(height, sizeof *n->row),
                                mem_array(width, sizeof *n->column)};
    for (uint32_t y = 0; y < n->height; y++) {
        double theta = latlong_polar(n->height, y);
        n->row[y] = (vec2){(float)sin(theta), (float)cos(theta)};
    }
    for (uint32_t x = 0; x < n->width; x++) {
        double phi = latlong_azimuth(n->width, x);
        n->column[x] = (vec2){(float)sin(phi), (float)cos(phi)};
    }
    for (size_t i = 0; i < pixels; i++)
        n->of[i] = is_known[i] ? (uint32_t)i : UNKNOWN;
}

void fill_angles(uint32_t width, uint32_t height, const bool *is_known, float *angle) {
    struct nearest_known n;
    nearest_init(&n, width, height, is_known);
    for (uint32_t y = 0; y < n.height; y++)
        propagate_row(&n, y, y > 0 ? y - 1 : y);
    for (uint32_t y = n.height; y-- > 0;)
        propagate_row(&n, y, y + 1 < n.height ? y + 1 : y);
    for (uint32_t i = 0; i < n.width * n.height; i++)
        angle[i] = angle_at(&n, i);
    mem_free(n.of);
    mem_free(n.row);
    mem_free(n.column);
}
