/* loss.h: two half-estimates give an unbiased gradient where one gives a biased one; saturated
 * pixels only push up. */
#include "server/refine/loss.h"

#include "common/rng.h"
#include "tests/check.h"

#define MEDIAN 1.0f

static struct photograph hdr = {.is_hdr = true, .exposure = 1.0f, .gain = {1, 1, 1}, .clip = INFINITY};

static struct photograph_sample reference(float value) {
    return (struct photograph_sample){.radiance = {value, value, value},
                                      .clip_radiance = {INFINITY, INFINITY, INFINITY}};
}

/* The render is a * X with X of mean 1 and standard deviation 1 (exponential); the true
 * gradient of w (a - R)^2 by a is 2 w (a - R). A path's dI/da is its X. */
static void test_unbiased(void) {
    const float a = 0.6f, target = 0.5f;
    const int trials = 400000;
    struct photograph_sample refs[2] = {reference(target), reference(target)};
    double w = (double)loss_weight(&hdr, &refs[0], MEDIAN);
    double two = 0.0, squares = 0.0, one = 0.0, loss = 0.0;
    for (int t = 0; t < trials; t++) {
        uint64_t bits = rng_key(1, (uint64_t)t, 0);
        float x[2] = {-logf(1.0f - rng_to_float((uint32_t)bits)), -logf(1.0f - rng_to_float((uint32_t)(bits >> 32)))};
        rgb radiance[2] = {rgb_gray(a * x[0]), rgb_gray(a * x[1])}, d[2];
        loss += (double)loss_pair(&hdr, refs, radiance, 2, false, MEDIAN, d) / 3.0;
        double gradient = (double)(d[0].r * x[0] + d[1].r * x[1]);
        two += gradient;
        squares += gradient * gradient;
        loss_pair(&hdr, refs, radiance, 2, true, MEDIAN, d);
        one += (double)(d[0].r * x[0] + d[1].r * x[1]);
    }
    two /= trials;
    one /= trials;
    double error = sqrt(squares / trials / trials);
    double wanted = 2.0 * w * (double)(a - target);
    CHECK_THAT(fabs(two - wanted) < 4.0 * error, "two estimates: %g, wanted %g, sigma %g", two, wanted, error);
    /* One estimate's bias is 2 w a Var(mean) = 2 w a / 2: the test could tell. */
    CHECK_NEAR(one - wanted, 2.0 * w * (double)a * 0.5, 0.1 * w);
    CHECK_NEAR(loss / trials, w * (double)((a - target) * (a - target)), 0.02 * w);
}

static void test_saturated(void) {
    struct photograph ldr = {.exposure = 1.0f, .gain = {1, 1, 1}, .clip = 0.98f};
    struct photograph_sample refs[2];
    for (int i = 0; i < 2; i++)
        refs[i] = (struct photograph_sample){
            .radiance = {1, 1, 0.5f}, .saturated = {true, true, false}, .clip_radiance = {0.98f, 0.98f, 0.98f}};
    rgb brighter[2] = {{3, 0.2f, 0.5f}, {2, 0.2f, 0.5f}}, d[2];
    loss_pair(&ldr, refs, brighter, 2, false, MEDIAN, d);
    CHECK(d[0].r == 0.0f && d[1].r == 0.0f);
    CHECK(d[0].g < 0.0f && d[1].g < 0.0f);
    CHECK_NEAR(d[0].b, 0.0, 1e-6);
}

/* A dark value of a short exposure is mostly quantisation: it weighs less than a clean one. */
static void test_weight(void) {
    struct photograph longer = {.exposure = 1.0f, .gain = {1, 1, 1}, .clip = 0.98f};
    struct photograph shorter = {.exposure = 1.0f / 166.66f, .gain = {1, 1, 1}, .clip = 0.98f};
    struct photograph_sample r = reference(0.5f);
    float exact = loss_weight(&hdr, &r, MEDIAN);
    CHECK_NEAR(exact, 1.0 / (0.25 + 0.01), 1e-3);
    CHECK(loss_weight(&longer, &r, MEDIAN) > 0.98f * exact);
    CHECK(loss_weight(&shorter, &r, MEDIAN) < 0.92f * exact);
}

int main(void) {
    test_unbiased();
    test_saturated();
    test_weight();
    return check_result();
}
