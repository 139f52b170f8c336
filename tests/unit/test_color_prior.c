/* color_prior.h: a chart that photographs show well expects its own colour, one that they do not show that
 * of the surfaces around it, and one that they show in mixed pixels only hardly more than that; where a part is clean,
 * that part tells. */
#include <math.h>

#include "common/image.h"
#include "common/mem.h"
#include "server/material/color_prior.h"
#include "server/state/reconstruction.h"
#include "tests/check.h"

#define WALLS 6
#define SIDE 32 /* texels of a wall */

/* Walls of 1 x 1 m in the plane z = 0, a row of them: white, hidden, mixed, and 20 m further black, a
 * lamp, and a black frame. Each has its own segment and chart. */
enum { WHITE, HIDDEN, MIXED, BLACK, LAMP, FRAME };
static const float left[WALLS] = {0, 1, 2, 20, 21, 22};

static vec3 position[WALLS * 4];
static uint32_t indices[WALLS * 2][3], of_triangle[WALLS * 2];
static vec2 corner[WALLS * 2][3];
static struct measurement measured[WALLS * SIDE * SIDE];

static void make_walls(void) {
    for (uint32_t w = 0; w < WALLS; w++) {
        for (uint32_t k = 0; k < 4; k++)
            position[4 * w + k] = (vec3){left[w] + (float)(k & 1), (float)(k >> 1), 0.0f};
        const uint32_t two[2][3] = {{0, 1, 2}, {1, 3, 2}};
        for (uint32_t t = 0; t < 2; t++) {
            of_triangle[2 * w + t] = w;
            for (uint32_t k = 0; k < 3; k++) {
                uint32_t at = two[t][k];
                indices[2 * w + t][k] = 4 * w + at;
                corner[2 * w + t][k] = (vec2){(float)(SIDE * (at & 1)), (float)(SIDE * (w + (at >> 1)))};
            }
        }
    }
}

/* All texels of a wall but the first `from`. */
static void show_from(uint32_t from, uint32_t wall, float value, float mixing) {
    for (uint32_t i = wall * SIDE * SIDE + from; i < (wall + 1) * SIDE * SIDE; i++) {
        uint16_t half = image_half_from_float(value);
        measured[i] =
            (struct measurement){.weight = 1.0f, .value = {half, half, half}, .mixing = image_half_from_float(mixing)};
    }
}

static void show(uint32_t wall, float value, float mixing) { show_from(0, wall, value, mixing); }

/* What each wall expects, and the same with three threads. */
static void check_walls(const struct surface *surface, const bool *is_emitter, struct parallel *pool) {
    struct color_prior *prior = color_priors(surface, is_emitter, measured, pool);
    CHECK_THAT(fabsf(prior[WHITE].mean.g - 0.9f) < 0.01f, "%g", (double)prior[WHITE].mean.g);
    CHECK_THAT(fabsf(prior[BLACK].mean.g - 0.05f) < 0.01f, "%g", (double)prior[BLACK].mean.g);
    CHECK_THAT(prior[BLACK].variance < 0.01f, "%g", (double)prior[BLACK].variance);
    CHECK_THAT(prior[HIDDEN].mean.g > 0.75f, "the white wall is beside it: %g", (double)prior[HIDDEN].mean.g);
    CHECK_THAT(prior[MIXED].mean.g < 1.2f, "%g", (double)prior[MIXED].mean.g);
    CHECK_THAT(prior[FRAME].mean.g < 0.05f, "%g", (double)prior[FRAME].mean.g);
    CHECK_THAT(prior[LAMP].mean.g > 0.3f && prior[LAMP].mean.g < 0.7f, "%g", (double)prior[LAMP].mean.g);

    struct parallel *three = parallel_new(3);
    struct color_prior *again = color_priors(surface, is_emitter, measured, three);
    CHECK(memcmp(prior, again, WALLS * sizeof *prior) == 0);
    mem_free(again);
    parallel_free(three);
    mem_free(prior);
}

/* Its own mean counts with the square of the share of its texels that is known: of one black texel among 1024, beside a
 * white wall, with .325^2 / (1 + .325^2) and not .325 / 1.325. (It is none that the grids take in.) */
static void check_own_share(const struct surface *surface, const bool *is_emitter, struct parallel *pool) {
    measured[HIDDEN * SIDE * SIDE + 1] = (struct measurement){.weight = 1.0f};
    CHECK((HIDDEN * SIDE * SIDE + 1) % 3 != 0);
    double share = 1.0 / 1025.0 / 0.003, part = share * share / (1.0 + share * share);
    struct color_prior *prior = color_priors(surface, is_emitter, measured, pool);
    float beside = prior[HIDDEN].mean.g;
    measured[HIDDEN * SIDE * SIDE + 1] = (struct measurement){0};
    mem_free(prior);
    prior = color_priors(surface, is_emitter, measured, pool);
    CHECK_NEAR(beside / prior[HIDDEN].mean.g, 1.0 - part, 0.01);
    mem_free(prior);
}

/* Where nothing is known at all, grey; and nothing is known well. */
static void check_unknown(const struct surface *surface, const bool *is_emitter, struct parallel *pool) {
    memset(measured, 0, sizeof measured);
    struct color_prior *prior = color_priors(surface, is_emitter, measured, pool);
    for (int w = 0; w < WALLS; w++)
        CHECK_THAT(prior[w].mean.r > 0.3f && prior[w].mean.r < 0.7f && prior[w].variance > 0.1f, "%d", w);
    mem_free(prior);
}

int main(void) {
    make_walls();
    bool is_emitter[WALLS] = {[LAMP] = true};
    struct scene scene = {
        .mesh = {.vertex_count = WALLS * 4, .position = position, .triangle_count = WALLS * 2, .index = indices}};
    struct reconstruction r = {.scene = &scene, .pool = parallel_new(1), .is_emitter = is_emitter};
    r.segments = (struct segments){.count = WALLS, .of_triangle = of_triangle};
    r.atlas = (struct atlas){.width = SIDE,
                             .height = WALLS * SIDE,
                             .texels_per_metre = SIDE,
                             .chart_count = WALLS,
                             .chart_of_triangle = of_triangle,
                             .corner = corner};
    inverse_uv_make(&r.inverse, &r.atlas, scene.mesh.triangle_count, r.pool);
    show(WHITE, 0.9f, 0.0f);
    show(MIXED, 3.0f, 20.0f);
    show(BLACK, 0.05f, 0.0f);
    show(LAMP, 4.0f, 0.0f);
    show(FRAME, 0.01f, 0.0f);
    show_from(SIDE * SIDE / 10, FRAME, 0.5f, 0.25f);

    const struct surface surface = reconstruction_surface(&r);
    check_walls(&surface, is_emitter, r.pool);
    check_own_share(&surface, is_emitter, r.pool);
    check_unknown(&surface, is_emitter, r.pool);
    inverse_uv_release(&r.inverse);
    parallel_free(r.pool);
    return check_result();
}
