/* specular_misfit.h: how sure a gain is where errors are shared by the observations of a photograph, by those of a
 * region, or by none; and that of a highlight that few photographs show. Noise of a photograph is no misfit of a
 * material, and no part of what all points share. */
#include "server/material/specular_misfit.h"

#include <math.h>

#include "common/image.h"
#include "common/mem.h"
#include "common/rng.h"
#include "tests/check.h"

#define COLUMNS 24
#define ROWS 16
#define POINTS (COLUMNS * ROWS)
#define VIEWS 5
#define PHOTOGRAPHS 24
#define DRAWS 300
#define DIFFERENCE 0.1 /* of the residuals of two candidates that explain equally well */
#define HIGHLIGHT 1.0  /* what a candidate without it leaves of a highlight, in three photographs */

static const struct specular_candidate_levels a = {0, 0}, b = {1, 1};

/* Uniform, deviation 1. */
static double draw(uint32_t key, uint32_t i, uint32_t k) {
    return (2.0 * (double)rng_to_float((uint32_t)(rng_key(key, i, k) >> 32)) - 1.0) * sqrt(3.0);
}

/* Deviations of the errors of a photograph, of a region and of an observation, in scales of the robust residual. */
struct errors {
    double photograph, region, own;
};

static struct specular_residual residual_of(double e) {
    return (struct specular_residual){image_half_from_float((float)(3.0 * e * e / (1.0 + e * e))),
                                      image_half_from_float((float)e)};
}

/* Standard errors of the gain of b over a: nothing but errors, or a highlight that b explains. */
static double gain_of(uint32_t key, const struct errors *errors, bool has_highlight, float noise, double floor) {
    struct specular_sample *sample = mem_calloc(POINTS, sizeof *sample);
    specular_residuals *residual = mem_calloc(POINTS * VIEWS, sizeof *residual);
    for (uint32_t i = 0; i < POINTS; i++) {
        uint32_t x = i % COLUMNS, y = i / COLUMNS, region = y / 3 * 8 + x / 3;
        sample[i].count = VIEWS;
        sample[i].position = (vec3){(float)x, (float)y, 0.0f};
        for (uint32_t v = 0; v < VIEWS; v++) {
            uint32_t photograph = (i * 7 + v * 5) % PHOTOGRAPHS, at = i * VIEWS + v;
            double e = errors->photograph * draw(key, photograph, 1) + errors->region * draw(key, region, 2) +
                       errors->own * draw(key, at, 3);
            double half = 0.5 * DIFFERENCE * ((errors->region > 0.0 ? region : photograph) % 2 ? 1.0 : -1.0);
            sample[i].view[v].train = photograph;
            sample[i].view[v].observed = rgb_gray(1.0f);
            sample[i].view[v].deviation = rgb_gray(noise);
            residual[at][a.k][a.m] = residual_of(has_highlight ? e + (photograph < 3 ? HIGHLIGHT : 0.0) : e + half);
            residual[at][b.k][b.m] = residual_of(has_highlight ? e : e - half);
        }
    }
    struct specular_points points = {POINTS, 1.0f, floor, sample, residual};
    struct specular_gain gain = specular_misfit_gain(&points, a, b);
    double sum = specular_misfit_sum(&points, a);
    CHECK_NEAR(gain.part * sum, sum - specular_misfit_sum(&points, b), 1e-6 * sum);
    mem_free(residual);
    mem_free(sample);
    return gain.errors;
}

/* Without a true gain standard errors deviate by 1, whoever shares the errors; a highlight is told still. */
static void test_calibrated(struct errors errors) {
    double squares = 0.0;
    for (uint32_t key = 0; key < DRAWS; key++) {
        double e = gain_of(key, &errors, false, 0.0f, 0.0);
        squares += e * e / DRAWS;
    }
    double highlight = gain_of(1, &errors, true, 0.0f, 0.0);
    printf("photograph %.2f, region %.2f, own %.2f: %.2f, highlight %.1f\n", errors.photograph, errors.region,
           errors.own, sqrt(squares), highlight);
    CHECK_THAT(sqrt(squares) > 0.7 && sqrt(squares) < 1.4, "standard errors deviate by %.2f", sqrt(squares));
    CHECK_THAT(highlight > 5.0, "a highlight is told by %.1f standard errors", highlight);
}

/* Of three looks at one paint, one is half as bright again by noise that is known: the paint is that of the others. */
static void test_noisy_look(void) {
    struct specular_sample sample = {.count = 3};
    struct specular_prediction prediction[3] = {0};
    specular_residuals residual[3];
    for (size_t v = 0; v < 3; v++) {
        sample.view[v].observed = rgb_gray(v == 2 ? 0.6f : 0.4f);
        sample.view[v].deviation = rgb_gray(v == 2 ? 0.3f : 0.0f);
        for (size_t k = 0; k < HIGHLIGHT_ROUGHNESSES; k++)
            prediction[v].unit_diffuse[k] = rgb_gray(1.0f);
    }
    specular_misfit_find(&sample, prediction, 1.0f, residual);
    for (size_t v = 0; v < 3; v++)
        CHECK_NEAR(image_float_from_half(residual[v][a.k][a.m].mean), v == 2 ? 0.65f : -0.1f, 0.1f);
}

/* What all points share is small where noise is most of the misfit. */
static void test_shared(void) {
    static const struct errors errors = {0.0, 0.0, 0.3};
    double clean = gain_of(1, &errors, true, 0.0f, 0.3), noisy = gain_of(1, &errors, true, 1.0f, 0.3);
    printf("a highlight where a third of the misfit is shared: %.1f, with noise %.1f\n", clean, noisy);
    CHECK(clean < 5.0 && noisy > 2.0 * clean);
}

int main(void) {
    test_noisy_look();
    test_shared();
    test_calibrated((struct errors){0.0, 0.0, 0.3});
    test_calibrated((struct errors){0.3, 0.0, 0.1});
    test_calibrated((struct errors){0.0, 0.3, 0.1});
    return check_result();
}
