/* rim.h: the step at the rim of a part of a grid of triangles: all of a sharp one, also where triangles at it are mixed
 * or show nothing; little of a smooth one; that of its own segment alone. */
#include "server/light/decision/rim.h"

#include <math.h>

#include "common/mem.h"
#include "tests/check.h"

#define ACROSS 24 /* squares of two triangles */
#define TRIANGLES (2 * ACROSS * ACROSS)
#define FIRST 8 /* the part is the squares [FIRST, END) both ways */
#define END 16

struct grid {
    struct mesh mesh;
    struct adjacency adjacency;
    uint32_t of_triangle[TRIANGLES], part[TRIANGLES], list[TRIANGLES];
    float observed[TRIANGLES];
    uint8_t side[TRIANGLES];
    size_t part_size;
};

static bool is_inside(int column, int row) { return column >= FIRST && column < END && row >= FIRST && row < END; }

static void make(struct grid *g) {
    *g = (struct grid){0};
    g->mesh.position = mem_array((ACROSS + 1) * (ACROSS + 1), sizeof *g->mesh.position);
    g->mesh.index = mem_array(TRIANGLES, sizeof *g->mesh.index);
    for (uint32_t i = 0; i < (ACROSS + 1) * (ACROSS + 1); i++)
        g->mesh.position[g->mesh.vertex_count++] = (vec3){(float)(i % (ACROSS + 1)), (float)(i / (ACROSS + 1)), 0.0f};
    for (uint32_t i = 0; i < ACROSS * ACROSS; i++) {
        uint32_t a = i / ACROSS * (ACROSS + 1) + i % ACROSS, up = a + ACROSS + 1;
        const uint32_t two[2][3] = {{a, a + 1, up + 1}, {a, up + 1, up}};
        for (int t = 0; t < 2; t++) {
            if (is_inside((int)(i % ACROSS), (int)(i / ACROSS)))
                g->part[g->part_size++] = (uint32_t)g->mesh.triangle_count;
            memcpy(g->mesh.index[g->mesh.triangle_count++], two[t], sizeof two[t]);
        }
    }
    adjacency_make(&g->adjacency, &g->mesh);
}

static void release(struct grid *g) {
    adjacency_release(&g->adjacency);
    mem_free(g->mesh.position);
    mem_free(g->mesh.index);
}

/* Distance of a square from the part's rim in squares; negative: within. */
static float off_rim(size_t triangle) {
    float column = (float)(triangle / 2 % ACROSS) + 0.5f, row = (float)(triangle / 2 / ACROSS) + 0.5f;
    float half = (END - FIRST) / 2.0f, middle = FIRST + half;
    return fmaxf(fabsf(column - middle), fabsf(row - middle)) - half;
}

static double step(struct grid *g, int triangles) {
    const struct rim rim = {&g->adjacency, g->of_triangle, g->observed, g->side};
    double found = rim_step(&rim, g->part, g->part_size, triangles, g->list);
    for (size_t t = 0; t < TRIANGLES; t++)
        CHECK(g->side[t] == 0);
    return found;
}

static void test_sharp(struct grid *g) {
    for (size_t t = 0; t < TRIANGLES; t++)
        g->observed[t] = off_rim(t) < 0.0f ? 10.0f : 1.0f;
    for (int triangles = 1; triangles < 40; triangles += 3)
        CHECK_NEAR(step(g, triangles), log(10.0), 1e-6);
    for (size_t t = 0; t < TRIANGLES; t++) /* one square to both sides */
        g->observed[t] = fabsf(off_rim(t)) < 1.0f ? 4.0f : g->observed[t];
    CHECK_NEAR(step(g, 1), 0.0, 1e-6);
    CHECK_NEAR(step(g, 4), log(10.0), 1e-6);
    for (size_t t = 0; t < TRIANGLES; t++)
        g->observed[t] = fabsf(off_rim(t)) < 1.0f ? -1.0f : g->observed[t];
    CHECK_NEAR(step(g, 4), log(10.0), 1e-6);
    for (size_t t = 0; t < TRIANGLES; t++) /* nothing is known farther off */
        g->observed[t] = fabsf(off_rim(t)) > 1.0f ? -1.0f : off_rim(t) < 0.0f ? 10.0f : 1.0f;
    CHECK_NEAR(step(g, 6), log(10.0), 1e-6);
}

/* Falls off by .1 in the logarithm from square to square. */
static void test_smooth(struct grid *g) {
    for (size_t t = 0; t < TRIANGLES; t++)
        g->observed[t] = expf(-0.1f * off_rim(t));
    CHECK_NEAR(step(g, 1), 0.1, 0.05);
    CHECK_NEAR(step(g, 5), 0.5, 0.2);
}

/* What is beside it in another segment does not count. */
static void test_segments(struct grid *g) {
    for (size_t t = 0; t < TRIANGLES; t++) {
        g->observed[t] = off_rim(t) < 0.0f ? 10.0f : 1.0f;
        g->of_triangle[t] = off_rim(t) < 0.0f ? 0 : 1;
    }
    CHECK(isinf(step(g, 3)));
    for (size_t t = 0; t < TRIANGLES; t++) { /* but for one side */
        bool is_one_side = t / 2 % ACROSS >= END;
        g->of_triangle[t] = off_rim(t) < 0.0f || is_one_side ? 0 : 1;
        g->observed[t] = is_one_side ? 5.0f : g->observed[t];
    }
    CHECK_NEAR(step(g, 3), log(2.0), 1e-6);
}

int main(void) {
    struct grid g;
    make(&g);
    test_sharp(&g);
    test_smooth(&g);
    test_segments(&g);
    release(&g);
    return check_result();
}
