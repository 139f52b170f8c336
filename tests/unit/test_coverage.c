/* test_coverage.c -- coverage.c against clipping by brute force; its symmetries. */
#include "server/scene/coverage.h"

#include "common/rng.h"
#include "tests/check.h"

#define SIZE 12 /* cells a side of the test's field */

typedef unsigned char field[SIZE][SIZE];

static void cover(const struct coverage_triangle *triangle, int32_t cell, field covered) {
    int32_t y0, y1, x0, x1;
    memset(covered, 0, sizeof(field));
    coverage_rows(triangle, cell, &y0, &y1);
    for (int32_t y = y0; y <= y1; y++) {
        coverage_columns(triangle, cell, y, &x0, &x1);
        CHECK(x0 <= x1);
        for (int32_t x = x0; x <= x1; x++) {
            CHECK(x >= 0 && x < SIZE && y >= 0 && y < SIZE);
            covered[y][x] = 1;
        }
    }
}

/* Separating axes of the closed square grown by a unit and the closed triangle, in whole
 * numbers: two convex shapes meet unless an edge's normal of either separates them. */
static int meets(const struct coverage_triangle *t, int32_t cell, int32_t column, int32_t row) {
    int64_t x0 = (int64_t)column * cell - 1, x1 = (int64_t)(column + 1) * cell + 1;
    int64_t y0 = (int64_t)row * cell - 1, y1 = (int64_t)(row + 1) * cell + 1;
    int64_t axis[5][2] = {{1, 0}, {0, 1}};
    for (int i = 0; i < 3; i++) {
        axis[2 + i][0] = t->y[i] - t->y[(i + 1) % 3];
        axis[2 + i][1] = t->x[(i + 1) % 3] - t->x[i];
    }
    int64_t corner[4][2] = {{x0, y0}, {x1, y0}, {x0, y1}, {x1, y1}};
    for (int a = 0; a < 5; a++) {
        int64_t low[2] = {INT64_MAX, INT64_MAX}, high[2] = {INT64_MIN, INT64_MIN};
        for (int i = 0; i < 7; i++) {
            int64_t x = i < 4 ? corner[i][0] : t->x[i - 4], y = i < 4 ? corner[i][1] : t->y[i - 4];
            int64_t along = x * axis[a][0] + y * axis[a][1];
            int which = i < 4;
            low[which] = along < low[which] ? along : low[which];
            high[which] = along > high[which] ? along : high[which];
        }
        if (low[0] > high[1] || low[1] > high[0])
            return 0;
    }
    return 1;
}

static int32_t pick(uint64_t a, uint64_t b, int32_t most) { return (int32_t)(rng_key(a, b, 5) % (uint64_t)(most + 1)); }

/* Corners in units; some on borders of cells, some flat or a point. */
static struct coverage_triangle random_triangle(uint64_t i, int32_t cell) {
    struct coverage_triangle t;
    int32_t room = (SIZE - 2) * cell - 4, grain = i % 3 == 0 ? cell / 2 : 1;
    int32_t extent = i % 5 == 0 ? cell : room;
    for (int c = 0; c < 3; c++) {
        t.x[c] = cell + 2 + pick(i, (uint64_t)c, extent) / grain * grain;
        t.y[c] = cell + 2 + pick(i, (uint64_t)c + 10, extent) / grain * grain;
    }
    if (i % 7 == 0)
        t.x[2] = t.x[1], t.y[2] = t.y[1];
    if (i % 49 == 0)
        t.x[1] = t.x[2] = t.x[0], t.y[1] = t.y[2] = t.y[0];
    return t;
}

int main(void) {
    for (uint64_t i = 0; i < 4000; i++) {
        int32_t cell = COVERAGE_UNITS << (i % 3);
        struct coverage_triangle t = random_triangle(i, cell);
        field straight, turned, mirrored;
        cover(&t, cell, straight);
        struct coverage_triangle quarter = t, mirror = t;
        for (int c = 0; c < 3; c++) {
            quarter.x[c] = SIZE * cell - t.y[c];
            quarter.y[c] = t.x[c];
            mirror.x[c] = SIZE * cell - t.x[c];
        }
        cover(&quarter, cell, turned);
        cover(&mirror, cell, mirrored);
        int wrong = 0, turns = 0, mirrors = 0;
        for (int32_t y = 0; y < SIZE; y++)
            for (int32_t x = 0; x < SIZE; x++) {
                wrong += straight[y][x] != meets(&t, cell, x, y);
                turns += straight[y][x] != turned[x][SIZE - 1 - y];
                mirrors += straight[y][x] != mirrored[y][SIZE - 1 - x];
            }
        CHECK_THAT(wrong == 0 && turns == 0 && mirrors == 0,
                   "triangle %d: %d cells wrong, %d when turned, %d when mirrored", (int)i, wrong, turns, mirrors);
    }
    return check_result();
}
