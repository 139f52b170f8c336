/* joint_fit.h: closed forms. Small spheres over a plane light points of known albedo; their radiances come back, with
 * standard deviations that the errors keep to; what cannot be told apart is told together; bounds hold; a source that
 * is not there gains nothing; the result is a minimum, and the same for any number of threads. */
#include <math.h>
#include <string.h>

#include "common/rng.h"
#include "server/light/joint_alike.h"
#include "server/light/joint_fit.h"
#include "server/light/light_model.h"
#include "tests/check.h"

#define SIDE 40 /* points along each side of a floor of 4 x 4 m */
#define POINTS (SIDE * SIDE)
#define PATCH 4 /* points along each side of a patch */

static struct joint_point point[POINTS];
static float albedo[POINTS], lit[2][POINTS];

/* Normal deviate of a point. */
static float deviate(uint64_t seed, uint32_t i, uint32_t k) {
    double u = fmax((double)rng_to_float((uint32_t)rng_key(seed, i, 2 * k)), 1e-7);
    return (float)(sqrt(-2.0 * log(u)) *
                   cos(6.283185307 * (double)rng_to_float((uint32_t)rng_key(seed, i, 2 * k + 1))));
}

/* Radiance of a white floor below a sphere of radius r at (x, height, y): L r^2 h / (d^2)^(3/2) for r << d. */
static float sphere_light(float x, float y, float height, float px, float py) {
    float square = (px - x) * (px - x) + (py - y) * (py - y) + height * height;
    return 0.01f * height / (square * sqrtf(square));
}

/* A floor of one segment: known light of `known` everywhere, and spheres of radiances x. Albedo varies by `spread` from
 * point to point, and by a part of that from patch to patch. */
static void make_floor(uint64_t seed, float known, const float x[2], float spread) {
    size_t at = 0;
    for (uint32_t patch = 0; patch < POINTS / (PATCH * PATCH); patch++) {
        float shift = 0.5f * spread * deviate(seed, patch, 1);
        for (uint32_t k = 0; k < PATCH * PATCH; k++, at++) {
            uint32_t column = patch % (SIDE / PATCH) * PATCH + k % PATCH,
                     row = patch / (SIDE / PATCH) * PATCH + k / PATCH;
            float px = 0.1f * (float)column, py = 0.1f * (float)row;
            lit[0][at] = sphere_light(1.0f, 1.0f, 0.8f, px, py);
            lit[1][at] = sphere_light(3.0f, 3.0f, 1.2f, px, py);
            albedo[at] = 0.4f * expf(shift + spread * deviate(seed, (uint32_t)at, 2));
            float light = known + x[0] * lit[0][at] + x[1] * lit[1][at];
            point[at] = (struct joint_point){0, patch, albedo[at] * light, known, 0.0f, false, false};
        }
    }
}

static struct joint_source source_about(double mean, double deviation) {
    return (struct joint_source){.mean = mean, .deviation = deviation, .least = -INFINITY, .value = mean};
}

static void start(struct joint_fit *f, struct parallel *pool) { joint_fit_init(f, point, POINTS, 4, pool); }

static void test_recovers(struct parallel *pool) {
    const float x[2] = {60.0f, 25.0f};
    struct joint_fit f;
    struct joint_source prior = source_about(log(30.0), 1.5);
    make_floor(1, 0.5f, x, 0.0f);
    start(&f, pool);
    joint_fit_add(&f, &prior, lit[0]);
    joint_fit_add(&f, &prior, lit[1]);
    joint_fit_solve(&f);
    CHECK_NEAR(exp(f.source[1].value), (double)x[0], 0.02 * (double)x[0]);
    CHECK_NEAR(exp(f.source[2].value), (double)x[1], 0.02 * (double)x[1]);
    joint_fit_release(&f);
}

/* Mean logarithm of the light over all points, of sources of radiances x. */
static double mean_light(double known, const double x[2]) {
    double sum = 0.0;
    for (size_t i = 0; i < POINTS; i++)
        sum += log(known + x[0] * (double)lit[0][i] + x[1] * (double)lit[1][i]) / POINTS;
    return sum;
}

/* Of 40 floors: 60 to 80 % of the errors within one deviation would be 24 to 32; binomial chance widens it by 9. Of the
 * light of 20 floors it is 12 to 16, and 7. */
static void test_deviations(struct parallel *pool) {
    const float x[2] = {60.0f, 25.0f};
    int one = 0, two = 0, all = 0, light_one = 0;
    struct joint_source prior = source_about(log(30.0), 1.5);
    for (uint64_t seed = 1; seed <= 20; seed++) {
        struct joint_fit f;
        make_floor(seed, 0.5f, x, 0.25f);
        start(&f, pool);
        joint_fit_add(&f, &prior, lit[0]);
        joint_fit_add(&f, &prior, lit[1]);
        joint_fit_solve(&f);
        joint_fit_errors(&f);
        for (int k = 0; k < 2; k++, all++) {
            double off = fabs(f.source[1 + k].value - log((double)x[k])) / f.source[1 + k].error;
            one += off < 1.0;
            two += off < 2.0;
        }
        const double found[2] = {exp(f.source[1].value), exp(f.source[2].value)};
        double off = mean_light(0.5, found) - mean_light(0.5, (const double[2]){(double)x[0], (double)x[1]});
        light_one += fabs(off) < f.light_error;
        joint_fit_release(&f);
    }
    CHECK_THAT(one > 15 && one < 38 && two > 33, "%d and %d of %d within one and two deviations", one, two, all);
    CHECK_THAT(light_one > 5 && light_one < 20, "the light of %d of 20 within one deviation", light_one);
}

/* Two sources of the same light: their sum is known, and so is what all points get; which of them it is is not. */
static void test_alike(struct parallel *pool) {
    const float x[2] = {60.0f, 0.0f};
    struct joint_fit f;
    struct joint_source prior = source_about(log(30.0), 1.5);
    make_floor(3, 0.5f, x, 0.1f);
    start(&f, pool);
    joint_fit_add(&f, &prior, lit[0]);
    joint_fit_add(&f, &prior, lit[0]);
    joint_fit_solve(&f);
    joint_fit_errors(&f);
    CHECK_NEAR(exp(f.source[1].value) + exp(f.source[2].value), 60.0, 6.0);
    CHECK(f.source[1].error > 0.5 && f.source[2].error > 0.5);
    CHECK_NEAR(f.source[0].share, 0.0, 1e-9);
    double share = f.source[1].share + f.source[2].share;
    CHECK(share > 0.1 && share < 1.0);
    CHECK_THAT(f.light_error < 0.15 * share, "%g of sources that are %g of all light", f.light_error, share);
    joint_fit_release(&f);
}

/* Once one of two lamps of the same light is there, the other one gains nothing: they are reported as one. */
static void test_alike_is_one(struct parallel *pool) {
    const float x[2] = {60.0f, 0.0f};
    struct joint_fit f;
    struct joint_source first = source_about(log(30.0), 1.5), second = first;
    make_floor(9, 0.5f, x, 0.1f);
    start(&f, pool);
    CHECK(joint_fit_try(&f, &first, lit[0]) > 20.0);
    joint_fit_add(&f, &first, lit[0]);
    joint_fit_solve(&f);
    CHECK_NEAR(exp(f.source[1].value), 60.0, 6.0);
    double gain = joint_fit_try(&f, &second, lit[0]);
    CHECK_THAT(gain < 1.0, "%g nats", gain);
    joint_fit_release(&f);
}

/* Two equal saturated lamps side by side: what each of them sends cannot be told, 15 to 105 for 60. As one source
 * (light_lamp.c) they are as bright as they are. */
static void test_equal_lamps(struct parallel *pool) {
    const float x[2] = {0.0f, 0.0f};
    static float column[3][POINTS];
    struct joint_fit f;
    struct joint_source lamp = {.mean = log(15.0), .deviation = 2.0, .least = log(15.0), .value = log(15.0)};
    double most = 0.0;
    for (uint64_t seed = 1; seed <= 8; seed++) {
        make_floor(seed, 0.5f, x, 0.25f);
        for (size_t i = 0; i < POINTS; i++) {
            uint32_t patch = (uint32_t)(i / (PATCH * PATCH)), k = (uint32_t)(i % (PATCH * PATCH));
            float px = 0.1f * (float)(patch % (SIDE / PATCH) * PATCH + k % PATCH),
                  py = 0.1f * (float)(patch / (SIDE / PATCH) * PATCH + k / PATCH);
            column[0][i] = sphere_light(1.9f, 2.0f, 1.5f, px, py);
            column[1][i] = sphere_light(2.1f, 2.0f, 1.5f, px, py);
            column[2][i] = column[0][i] + column[1][i];
            point[i].observed = albedo[i] * (0.5f + 60.0f * column[2][i]);
        }
        start(&f, pool);
        joint_fit_add(&f, &lamp, column[2]);
        joint_fit_solve(&f);
        double one = f.source[1].value;
        joint_fit_remove_last(&f);
        joint_fit_add(&f, &lamp, column[0]);
        joint_fit_add(&f, &lamp, column[1]);
        joint_fit_solve(&f);
        most = fmax(most, fabs(f.source[1].value - f.source[2].value));
        CHECK_NEAR(one, log(60.0), 0.3);
        joint_fit_release(&f);
    }
    CHECK_THAT(most > log(2.0), "%g", most);
}

static void test_bound(struct parallel *pool) {
    const float x[2] = {60.0f, 0.0f};
    struct joint_fit f;
    make_floor(4, 0.5f, x, 0.1f);
    start(&f, pool);
    struct joint_source loose = {.mean = log(40.0), .deviation = 2.0, .least = log(40.0), .value = log(40.0)},
                        tight = loose;
    tight.mean = tight.least = tight.value = log(90.0);
    joint_fit_add(&f, &loose, lit[0]);
    joint_fit_solve(&f);
    CHECK_NEAR(exp(f.source[1].value), 60.0, 6.0);
    joint_fit_remove_last(&f);
    joint_fit_add(&f, &tight, lit[0]);
    joint_fit_solve(&f);
    CHECK(f.source[1].value == tight.least);
    f.source[1].value = log(200.0); /* from above, too */
    joint_fit_solve(&f);
    CHECK(f.source[1].value == tight.least);
    joint_fit_release(&f);
}

/* Photographs saturate where a lamp lights most. Left out, or taken for what is there, these places would make it
 * dimmer than it is: only what is dark is measured there. Places of lamps say nothing, whatever they show. */
static void test_clipped_points(struct parallel *pool) {
    const float x[2] = {60.0f, 0.0f}, clip = 0.35f;
    struct joint_source prior = source_about(log(30.0), 1.5);
    double found[2] = {0.0, 0.0};
    for (int takes_bounds = 0; takes_bounds < 2; takes_bounds++) {
        for (uint64_t seed = 1; seed <= 8; seed++) {
            struct joint_fit f;
            make_floor(seed, 0.5f, x, 0.25f);
            for (size_t i = 0; i < POINTS; i++) {
                point[i].is_bound = takes_bounds && point[i].observed > clip;
                point[i].observed = fminf(point[i].observed, clip);
                point[i].is_lamp = i % 7 == 0;
                point[i].observed *= point[i].is_lamp ? 100.0f : 1.0f;
            }
            start(&f, pool);
            joint_fit_add(&f, &prior, lit[0]);
            joint_fit_solve(&f);
            found[takes_bounds] += exp(f.source[1].value) / 8.0;
            joint_fit_errors(&f);
            CHECK(isfinite(f.light_error));
            joint_fit_release(&f);
        }
    }
    printf("a lamp of 60 of which a part saturates: %.1f, without bounds %.1f\n", found[1], found[0]);
    CHECK_NEAR(found[1], 60.0, 6.0);
    CHECK(found[0] < 50.0);
}

/* What is whiter than white asks for light; what is darker does not ask for less. */
static void test_white(void) {
    CHECK(joint_white_bound(-1.0, 0.01).loss == 0.0 && joint_white_bound(-1.0, 0.01).slope == 0.0);
    CHECK(joint_white_bound(0.3, 0.01).loss > joint_white_bound(0.2, 0.01).loss &&
          joint_white_bound(0.2, 0.01).slope > 0.0);
}

static void test_try(struct parallel *pool) {
    const float x[2] = {60.0f, 0.0f};
    struct joint_fit f;
    struct joint_source there = source_about(log(30.0), 1.5), absent = there;
    make_floor(5, 0.5f, x, 0.2f);
    start(&f, pool);
    joint_fit_solve(&f);
    double without = joint_fit_loss(&f), gain = joint_fit_try(&f, &there, lit[0]);
    CHECK_NEAR(exp(there.value), 60.0, 15.0);
    joint_fit_add(&f, &there, lit[0]);
    CHECK_NEAR(joint_fit_loss(&f), without - gain, 1e-6 * without);
    joint_fit_solve(&f);
    CHECK_THAT(gain > 20.0, "%g nats", gain);
    double other = joint_fit_try(&f, &absent, lit[1]);
    CHECK_THAT(other < 3.0, "%g nats", other);
    joint_fit_release(&f);
}

/* No step away from the solution lowers the loss: the gradient is that of the loss. */
static void test_minimum(struct parallel *pool) {
    const float x[2] = {60.0f, 25.0f};
    struct joint_fit f;
    struct joint_source prior = source_about(log(30.0), 1.5);
    const struct joint_tie tie = {1, 2, 0.5, 1.0};
    make_floor(6, 0.1f, x, 0.25f);
    start(&f, pool);
    joint_fit_add(&f, &prior, lit[0]);
    joint_fit_add(&f, &prior, lit[1]);
    f.tie = &tie;
    f.tie_count = 1;
    double least = joint_fit_solve(&f);
    for (size_t j = 0; j < f.source_count; j++) {
        for (int side = -1; side <= 1; side += 2) {
            f.source[j].value += 0.03 * side;
            CHECK_THAT(joint_fit_loss(&f) > least - 1e-3, "source %zu", j);
            f.source[j].value -= 0.03 * side;
        }
    }
    joint_fit_release(&f);
}

/* Sixteen times the points in the same patches say less than sixteen times as much: patches have errors of their
 * own. */
static void test_patches(struct parallel *pool) {
    const float x[2] = {60.0f, 25.0f};
    static struct joint_point few[POINTS / 16];
    static float lit_few[POINTS / 16];
    struct joint_fit f;
    struct joint_source prior = source_about(log(30.0), 1.5);
    double error[2];
    make_floor(7, 0.5f, x, 0.25f);
    for (size_t i = 0; i < POINTS / 16; i++) {
        few[i] = point[16 * i];
        lit_few[i] = lit[0][16 * i];
    }
    for (int all = 0; all < 2; all++) {
        joint_fit_init(&f, all ? point : few, all ? POINTS : POINTS / 16, 4, pool);
        joint_fit_add(&f, &prior, all ? lit[0] : lit_few);
        joint_fit_solve(&f);
        joint_fit_errors(&f);
        error[all] = f.source[1].error;
        joint_fit_release(&f);
    }
    CHECK_THAT(error[1] < error[0] && error[1] > 0.35 * error[0], "%g and %g", error[0], error[1]);
}

/* Where errors of patches are drawn for each patch they count one by one; where one is drawn for each square of four,
 * four count as one. */
static void test_patches_alike(struct parallel *pool) {
    const float x[2] = {0.0f, 0.0f};
    double mean[2] = {0.0, 0.0};
    for (uint64_t seed = 1; seed <= 8; seed++) {
        for (int together = 0; together < 2; together++) {
            static vec3 position[POINTS];
            struct joint_fit f;
            make_floor(seed, 0.5f, x, 0.0f);
            for (size_t i = 0; i < POINTS; i++) {
                uint32_t row = point[i].patch / (SIDE / PATCH), column = point[i].patch % (SIDE / PATCH);
                uint32_t draw = together ? row / 2 * SIDE + column / 2 : row * SIDE + column;
                position[i] = (vec3){0.1f * PATCH * (float)column, 0.0f, 0.1f * PATCH * (float)row};
                point[i].observed *= expf(0.15f * deviate(seed, draw, 7));
            }
            start(&f, pool);
            mean[together] += joint_alike(&f, position, 0.6f, JOINT_ALIKE_ALL) / 8.0;
            joint_fit_release(&f);
        }
    }
    CHECK_THAT(mean[0] >= 1.0 && mean[0] < 1.3, "%g", mean[0]);
    CHECK_NEAR(mean[1], 4.0, 0.8);
}

/* Where errors agree in one half of the floor alone, as there, four patches count as one to the source that lights that
 * half, and one by one to the source of the other half. */
static void test_source_alike(struct parallel *pool) {
    const float x[2] = {0.0f, 0.0f};
    static vec3 position[POINTS];
    static float half[2][POINTS];
    double mean[2] = {0.0, 0.0};
    for (uint64_t seed = 1; seed <= 8; seed++) {
        struct joint_fit f;
        struct joint_source source = source_about(0.0, 1.0);
        make_floor(seed, 0.5f, x, 0.0f);
        for (size_t i = 0; i < POINTS; i++) {
            uint32_t row = point[i].patch / (SIDE / PATCH), column = point[i].patch % (SIDE / PATCH);
            int side = column < SIDE / PATCH / 2;
            position[i] = (vec3){0.1f * PATCH * (float)column, 0.0f, 0.1f * PATCH * (float)row};
            half[side][i] = 1.0f, half[!side][i] = 0.0f;
            uint32_t draw = side ? row / 2 * SIDE + column / 2 : row * SIDE + column;
            point[i].observed *= expf(0.15f * deviate(seed, draw, 7));
        }
        start(&f, pool);
        for (size_t side = 0; side < 2; side++)
            joint_fit_add(&f, &source, half[side]);
        for (size_t side = 0; side < 2; side++)
            mean[side] += joint_alike(&f, position, 0.6f, 1 + side) / 8.0;
        joint_fit_release(&f);
    }
    CHECK_THAT(mean[0] >= 1.0 && mean[0] < 1.5, "%g", mean[0]);
    CHECK_NEAR(mean[1], 4.0, 1.0);
}

/* The same of stated deviations (light_model.h): as many errors are within one as for independent patches, though four
 * agree. Patch by patch the deviations would be too small. */
static void test_deviations_alike(struct parallel *pool) {
    const float x[2] = {60.0f, 25.0f};
    static struct light_point at[POINTS];
    int one = 0, too_sure = 0, all = 0;
    for (uint64_t seed = 1; seed <= 20; seed++) {
        struct joint_source prior = source_about(log(30.0), 1.5);
        struct light_model m = {.points = {.count = POINTS, .point = at, .edge_m = 0.1f * PATCH}};
        make_floor(seed, 0.5f, x, 0.0f);
        for (size_t i = 0; i < POINTS; i++) {
            uint32_t row = point[i].patch / (SIDE / PATCH), column = point[i].patch % (SIDE / PATCH);
            at[i].at.position = (vec3){0.1f * PATCH * (float)column, 0.0f, 0.1f * PATCH * (float)row};
            point[i].observed *= expf(0.15f * deviate(seed, row / 2 * SIDE + column / 2, 7));
        }
        start(&m.fit, pool);
        joint_fit_add(&m.fit, &prior, lit[0]);
        joint_fit_add(&m.fit, &prior, lit[1]);
        joint_fit_solve(&m.fit);
        light_model_find_errors(&m);
        for (int k = 0; k < 2; k++, all++) {
            double off = fabs(m.fit.source[1 + k].value - log((double)x[k])) / m.fit.source[1 + k].error;
            one += off < 1.0;
            too_sure += off * sqrt(m.patches_alike) >= 1.0;
        }
        joint_fit_release(&m.fit);
    }
    printf("of %d errors %d within one deviation, %d if patches were independent\n", all, one, all - too_sure);
    CHECK(one > 18);
}

/* A lamp over a floor, half of it of albedo .6, half black wood of .05, whose varnish mirrors the lamp: .04 more below
 * it. What the wood shows of it says little. */
static void test_highlights(struct parallel *pool) {
    const float x[2] = {0.0f, 0.0f};
    static float column[POINTS], segment_albedo[2];
    struct joint_source lamp = source_about(log(30.0), 1.5);
    struct light_model m = {.points = {.count = POINTS}, .joint = point, .albedo = segment_albedo};
    make_floor(11, 0.5f, x, 0.0f);
    for (size_t i = 0; i < POINTS; i++) {
        uint32_t patch = (uint32_t)(i / (PATCH * PATCH)), k = (uint32_t)(i % (PATCH * PATCH));
        uint32_t row = patch / (SIDE / PATCH) * PATCH + k / PATCH, place = patch % (SIDE / PATCH) * PATCH + k % PATCH;
        bool is_wood = 2 * row >= SIDE;
        column[i] = sphere_light(2.0f, 2.0f, 0.8f, 0.1f * (float)place, 0.1f * (float)row);
        float own = 60.0f * column[i], light = 0.5f + own;
        point[i].segment = is_wood;
        point[i].observed = is_wood ? 0.05f * light + 0.04f * own : 0.6f * light;
    }
    start(&m.fit, pool);
    light_model_allow_for_highlights(&m);
    joint_fit_add(&m.fit, &lamp, column);
    joint_fit_solve(&m.fit);
    printf("a lamp of 60 beside its highlight: %.1f; black wood %.3f\n", exp(m.fit.source[1].value),
           (double)segment_albedo[1]);
    CHECK_NEAR(exp(m.fit.source[1].value), 60.0, 17.0); /* 82 without */
    joint_fit_release(&m.fit);
}

static void test_threads(void) {
    const float x[2] = {60.0f, 25.0f};
    double value[2][3];
    make_floor(8, 0.5f, x, 0.25f);
    for (int i = 0; i < 2; i++) {
        struct parallel *pool = parallel_new(1 + 2 * i);
        struct joint_source prior = source_about(log(30.0), 1.5);
        struct joint_fit f;
        start(&f, pool);
        joint_fit_add(&f, &prior, lit[0]);
        joint_fit_add(&f, &prior, lit[1]);
        value[i][2] = joint_fit_solve(&f);
        value[i][0] = f.source[1].value;
        value[i][1] = f.source[2].value;
        joint_fit_release(&f);
        parallel_free(pool);
    }
    CHECK(memcmp(value[0], value[1], sizeof value[0]) == 0);
}

int main(void) {
    struct parallel *pool = parallel_new(0);
    test_recovers(pool);
    test_deviations(pool);
    test_alike(pool);
    test_alike_is_one(pool);
    test_equal_lamps(pool);
    test_bound(pool);
    test_clipped_points(pool);
    test_white();
    test_try(pool);
    test_minimum(pool);
    test_patches(pool);
    test_patches_alike(pool);
    test_source_alike(pool);
    test_deviations_alike(pool);
    test_highlights(pool);
    test_threads();
    parallel_free(pool);
    return check_result();
}
