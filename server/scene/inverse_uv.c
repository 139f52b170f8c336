/* inverse_uv.c -- see inverse_uv.h.
 *
 * Bands of 32 rows are filled independently; within a band triangles come in ascending order, so
 * each texel's owner is the same whatever thread fills it. Texels and corners are exact multiples
 * of a unit (coverage.h), so "holds the centre" is decided exactly. */
#include "server/scene/inverse_uv.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "server/scene/coverage.h"

#define TILE 32 /* texels a side; also the rows of a band */

struct fill {
    struct inverse_uv *inverse;
    const struct atlas *atlas;
    size_t *start;      /* [band_count + 1] into `triangle` */
    uint32_t *triangle; /* by band, ascending within one */
    double **distance;  /* [thread_count][TILE * width] squared distance of the owner so far */
    size_t *offset;     /* [band_count + 1] of the band's texels in `valid` */
};

static struct coverage_triangle units_of(const struct atlas *atlas, size_t t) {
    struct coverage_triangle u;
    for (int c = 0; c < 3; c++) {
        u.x[c] = (int32_t)lrintf(atlas->corner[t][c].x * COVERAGE_UNITS);
        u.y[c] = (int32_t)lrintf(atlas->corner[t][c].y * COVERAGE_UNITS);
    }
    return u;
}

/* Rows of the image that the triangle covers; false when there are none. */
static bool rows_of(const struct coverage_triangle *u, uint32_t height, int32_t *first, int32_t *last) {
    coverage_rows(u, COVERAGE_UNITS, first, last);
    if (*first < 0)
        *first = 0;
    if (*last >= (int32_t)height)
        *last = (int32_t)height - 1;
    return *first <= *last;
}

/* Squared distance, in units, of (px, py) from the closed triangle: exactly 0 inside. */
static double distance_squared(const struct coverage_triangle *u, int32_t px, int32_t py) {
    int positive = 0, negative = 0;
    double nearest = INFINITY;
    for (int i = 0; i < 3; i++) {
        int j = i == 2 ? 0 : i + 1;
        int64_t ex = u->x[j] - u->x[i], ey = u->y[j] - u->y[i];
        int64_t qx = px - u->x[i], qy = py - u->y[i];
        int64_t side = ex * qy - ey * qx;
        positive += side > 0;
        negative += side < 0;
        int64_t along = ex * qx + ey * qy, length = ex * ex + ey * ey;
        double part = along <= 0 ? 0.0 : along >= length ? 1.0 : (double)along / (double)length;
        double dx = (double)qx - part * (double)ex, dy = (double)qy - part * (double)ey;
        nearest = fmin(nearest, dx * dx + dy * dy);
    }
    /* All sides 0: no area, and the nearest edge decides. */
    return (positive == 0 || negative == 0) && positive + negative > 0 ? 0.0 : nearest;
}

static void fill_band(void *user, size_t band, int thread) {
    struct fill *fill = user;
    uint32_t width = fill->inverse->width;
    int32_t top = (int32_t)band * TILE;
    int32_t rows = (int32_t)fill->inverse->height - top;
    rows = rows < TILE ? rows : TILE;
    uint32_t *owner = fill->inverse->triangle + (size_t)top * width;
    double *distance = fill->distance[thread];
    memset(owner, 0xff, (size_t)rows * width * sizeof *owner);
    size_t valid_count = 0;
    for (size_t i = fill->start[band]; i < fill->start[band + 1]; i++) {
        uint32_t t = fill->triangle[i];
        struct coverage_triangle u = units_of(fill->atlas, t);
        int32_t y0, y1, x0, x1;
        rows_of(&u, fill->inverse->height, &y0, &y1);
        y0 = y0 > top ? y0 : top;
        y1 = y1 < top + rows ? y1 : top + rows - 1;
        for (int32_t y = y0; y <= y1; y++) {
            coverage_columns(&u, COVERAGE_UNITS, y, &x0, &x1);
            x0 = x0 > 0 ? x0 : 0;
            x1 = x1 < (int32_t)width ? x1 : (int32_t)width - 1;
            for (int32_t x = x0; x <= x1; x++) {
                size_t at = (size_t)(y - top) * width + (size_t)x;
                if (owner[at] != INVERSE_UV_NONE && distance[at] == 0.0)
                    continue;
                double d = distance_squared(&u, x * COVERAGE_UNITS + COVERAGE_UNITS / 2,
                                            y * COVERAGE_UNITS + COVERAGE_UNITS / 2);
                if (owner[at] == INVERSE_UV_NONE)
                    valid_count++;
                else if (d >= distance[at])
                    continue;
                owner[at] = t;
                distance[at] = d;
            }
        }
    }
    fill->offset[band + 1] = valid_count;
}

static void list_band(void *user, size_t band, int thread) {
    (void)thread;
    struct fill *fill = user;
    struct inverse_uv *inverse = fill->inverse;
    uint32_t *out = inverse->valid + fill->offset[band];
    uint32_t top = (uint32_t)band * TILE;
    uint32_t bottom = top + TILE < inverse->height ? top + TILE : inverse->height;
    for (uint32_t left = 0; left < inverse->width; left += TILE) {
        uint32_t right = left + TILE < inverse->width ? left + TILE : inverse->width;
        for (uint32_t y = top; y < bottom; y++)
            for (uint32_t x = left; x < right; x++)
                if (inverse->triangle[(size_t)y * inverse->width + x] != INVERSE_UV_NONE)
                    *out++ = y * inverse->width + x;
    }
}

/* Fills start and triangle: a counting sort of the triangles by the bands they touch. */
static void sort_by_band(struct fill *fill, size_t band_count, size_t triangle_count) {
    int32_t first, last;
    fill->start = mem_calloc(band_count + 2, sizeof *fill->start);
    for (size_t t = 0; t < triangle_count; t++) {
        struct coverage_triangle u = units_of(fill->atlas, t);
        if (rows_of(&u, fill->atlas->height, &first, &last))
            for (int32_t band = first / TILE; band <= last / TILE; band++)
                fill->start[band + 2]++;
    }
    for (size_t band = 0; band < band_count; band++)
        fill->start[band + 2] += fill->start[band + 1];
    fill->triangle = mem_array(fill->start[band_count + 1], sizeof *fill->triangle);
    for (size_t t = 0; t < triangle_count; t++) {
        struct coverage_triangle u = units_of(fill->atlas, t);
        if (rows_of(&u, fill->atlas->height, &first, &last))
            for (int32_t band = first / TILE; band <= last / TILE; band++)
                fill->triangle[fill->start[band + 1]++] = (uint32_t)t;
    }
}

void inverse_uv_make(struct inverse_uv *inverse, const struct atlas *atlas, size_t triangle_count,
                     struct parallel *pool) {
    size_t band_count = (atlas->height + TILE - 1) / TILE;
    int thread_count = parallel_thread_count(pool);
    inverse->width = atlas->width;
    inverse->height = atlas->height;
    inverse->triangle = mem_array((size_t)atlas->width * atlas->height, sizeof *inverse->triangle);
    struct fill fill = {.inverse = inverse, .atlas = atlas};
    sort_by_band(&fill, band_count, triangle_count);
    fill.offset = mem_calloc(band_count + 1, sizeof *fill.offset);
    fill.distance = mem_array((size_t)thread_count, sizeof *fill.distance);
    for (int i = 0; i < thread_count; i++)
        fill.distance[i] = mem_array((size_t)TILE * atlas->width, sizeof **fill.distance);
    parallel_for(pool, band_count, fill_band, &fill);
    for (size_t band = 0; band < band_count; band++)
        fill.offset[band + 1] += fill.offset[band];
    inverse->valid_count = fill.offset[band_count];
    inverse->valid = mem_array(inverse->valid_count, sizeof *inverse->valid);
    parallel_for(pool, band_count, list_band, &fill);
    for (int i = 0; i < thread_count; i++)
        mem_free(fill.distance[i]);
    mem_free(fill.distance);
    mem_free(fill.offset);
    mem_free(fill.triangle);
    mem_free(fill.start);
}

void inverse_uv_release(struct inverse_uv *inverse) {
    mem_free(inverse->triangle);
    mem_free(inverse->valid);
    *inverse = (struct inverse_uv){0};
}

/* Barycentrics of the point of the triangle c nearest to (x, y). */
static void nearest_point(const vec2 c[3], double x, double y, float *b1, float *b2) {
    double ux = (double)c[1].x - (double)c[0].x, uy = (double)c[1].y - (double)c[0].y;
    double vx = (double)c[2].x - (double)c[0].x, vy = (double)c[2].y - (double)c[0].y;
    double qx = x - (double)c[0].x, qy = y - (double)c[0].y;
    double area = ux * vy - uy * vx;
    if (area != 0.0) {
        double p1 = (qx * vy - qy * vx) / area, p2 = (ux * qy - uy * qx) / area;
        if (p1 >= 0.0 && p2 >= 0.0 && p1 + p2 <= 1.0) {
            *b1 = (float)p1;
            *b2 = (float)p2;
            return;
        }
    }
    double nearest = INFINITY;
    for (int i = 0; i < 3; i++) {
        int j = i == 2 ? 0 : i + 1;
        double ex = (double)c[j].x - (double)c[i].x, ey = (double)c[j].y - (double)c[i].y;
        double rx = x - (double)c[i].x, ry = y - (double)c[i].y;
        double length = ex * ex + ey * ey;
        double part = length > 0.0 ? (ex * rx + ey * ry) / length : 0.0;
        part = part < 0.0 ? 0.0 : part > 1.0 ? 1.0 : part;
        double dx = rx - part * ex, dy = ry - part * ey;
        if (dx * dx + dy * dy >= nearest)
            continue;
        nearest = dx * dx + dy * dy;
        float weight[3] = {0.0f, 0.0f, 0.0f};
        weight[i] = (float)(1.0 - part);
        weight[j] = (float)part;
        *b1 = weight[1];
        *b2 = weight[2];
    }
}

bool inverse_uv_lookup(const struct inverse_uv *inverse, const struct atlas *atlas, float x, float y,
                       uint32_t *triangle, float *b1, float *b2) {
    if (!(x >= 0.0f && y >= 0.0f && x < (float)inverse->width && y < (float)inverse->height))
        return false;
    uint32_t t = inverse->triangle[(size_t)y * inverse->width + (size_t)x];
    if (t == INVERSE_UV_NONE)
        return false;
    *triangle = t;
    nearest_point(atlas->corner[t], (double)x, (double)y, b1, b2);
    return true;
}
