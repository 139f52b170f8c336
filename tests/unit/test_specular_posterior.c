/* specular_posterior.h: when segments of one colour influence each other, and when they do not. */
#include "server/material/specular_posterior.h"

#include <math.h>

#include "tests/check.h"

#define SMALL 0.002
#define LARGE 0.2

static const rgb white = {0.85f, 0.85f, 0.85f}, brown = {0.4f, 0.2f, 0.1f};

/* Evidence for the given lobe: likelihoods fall as a normal distribution of deviation `error` in roughness and
 * specular. */
static struct specular_evidence evidence(double part, rgb color, double roughness, double specular, double error) {
    struct specular_evidence t = {.is_observed = true, .part = part, .base_color = color, .best_roughness = roughness};
    double most = -1.0;
    for (size_t k = 0; k < HIGHLIGHT_ROUGHNESSES; k++) {
        for (size_t m = 0; m < HIGHLIGHT_SPECULARS; m++) {
            size_t c = specular_candidate(k, m);
            double r = (double)specular_levels.roughness[k] - roughness,
                   s = (double)specular_levels.specular[m] - specular;
            t.likelihood[c] = exp(-0.5 * (r * r + s * s) / (error * error));
            if (t.likelihood[c] > most)
                t.best = c, most = t.likelihood[c];
        }
    }
    t.likelihood[SPECULAR_DIFFUSE] =
        exp(-0.5 * ((1.0 - roughness) * (1.0 - roughness) + specular * specular) / (error * error));
    return t;
}

static void test_alone(void) {
    struct specular_evidence one[] = {evidence(SMALL, white, 0.3, 0.5, 0.05)};
    struct specular_posterior b = specular_posterior(one, 1, 0);
    CHECK(b.diffuse < 1e-6);
    CHECK_NEAR(b.roughness, 0.3, 0.03);
    CHECK_NEAR(b.specular, 0.5, 0.02);
    one[0] = evidence(SMALL, white, 1.0, 0.0, 0.05);
    CHECK(specular_posterior(one, 1, 0).diffuse > 0.99);
    one[0] = evidence(SMALL, white, 0.5, 0.5, 100.0); /* flat likelihood: the prior */
    b = specular_posterior(one, 1, 0);
    CHECK_NEAR(b.diffuse, 0.36, 0.01);
    CHECK_NEAR(b.specular / (1.0 - b.diffuse), 0.54, 0.02);
}

/* Where only the best candidate is likely, its refined roughness is the result. */
static void test_between(void) {
    struct specular_evidence one[] = {evidence(SMALL, white, 0.45, 0.5, 0.01)};
    one[0].best_roughness = 0.43;
    CHECK_NEAR(specular_posterior(one, 1, 0).roughness, 0.43, 1e-4);
}

/* Four segments of weak evidence each, and of strong evidence together. */
static void test_together(void) {
    struct specular_evidence four[] = {evidence(SMALL, white, 0.4, 0.5, 0.5), evidence(SMALL, white, 0.4, 0.5, 0.5),
                                       evidence(SMALL, white, 0.4, 0.5, 0.5), evidence(SMALL, white, 0.4, 0.5, 0.5)};
    double alone = specular_posterior(four, 1, 0).diffuse, last = alone;
    CHECK(alone > 0.1);
    for (size_t count = 2; count <= 4; count++) {
        double diffuse = specular_posterior(four, count, 0).diffuse;
        CHECK(diffuse < last);
        last = diffuse;
    }
    CHECK(last < 0.6 * alone);
}

/* A certain segment moves an uncertain one, unless it has another colour, is large, or has no observations; the certain
 * one stays. */
static void test_influence(void) {
    struct specular_evidence pair[] = {evidence(SMALL, white, 0.5, 0.3, 0.6), evidence(SMALL, white, 0.2, 0.5, 0.03)};
    struct specular_posterior alone = specular_posterior(pair, 1, 0), with = specular_posterior(pair, 2, 0);
    CHECK(with.diffuse < 0.5 * alone.diffuse && with.roughness < alone.roughness - 0.1);
    struct specular_posterior sure = specular_posterior(pair, 2, 1), sure_alone = specular_posterior(pair + 1, 1, 0);
    CHECK_NEAR(sure.roughness, sure_alone.roughness, 0.01);
    struct specular_evidence other = pair[1];
    pair[1].base_color = brown;
    CHECK_NEAR(specular_posterior(pair, 2, 0).roughness, alone.roughness, 1e-12);
    pair[1] = other, pair[1].part = LARGE;
    CHECK_NEAR(specular_posterior(pair, 2, 0).roughness, alone.roughness, 1e-12);
    pair[1] = other, pair[1].is_observed = false;
    CHECK_NEAR(specular_posterior(pair, 2, 0).roughness, alone.roughness, 1e-12);
    pair[1] = other, pair[1].base_color = rgb_gray(0.95f); /* nearly the same colour moves it nearly as far */
    struct specular_posterior near = specular_posterior(pair, 2, 0);
    CHECK(near.roughness > with.roughness && near.roughness < alone.roughness - 0.05);
    pair[1] = other,
    pair[1].color_spread = rgb_gray(0.15f); /* a picture of the same mean, of which paint tells nothing */
    CHECK_NEAR(specular_posterior(pair, 2, 0).roughness, alone.roughness, 1e-12);
    pair[0].color_spread = rgb_gray(0.15f); /* but another such picture does */
    CHECK_NEAR(specular_posterior(pair, 2, 0).roughness, with.roughness, 1e-12);
}

/* Two of one colour with contradicting evidence both keep their own. */
static void test_contradiction(void) {
    struct specular_evidence pair[] = {evidence(SMALL, white, 0.15, 0.5, 0.03), evidence(SMALL, white, 1.0, 0.0, 0.03)};
    CHECK_NEAR(specular_posterior(pair, 2, 0).roughness, 0.15, 0.02);
    CHECK(specular_posterior(pair, 2, 1).diffuse > 0.99);
}

/* However many of one colour there are, and however sure each is. */
static void test_many(void) {
    struct specular_evidence many[200];
    for (size_t i = 0; i < 200; i++)
        many[i] = evidence(SMALL, white, 0.3, 0.5, 0.02);
    struct specular_posterior b = specular_posterior(many, 200, 7);
    CHECK_NEAR(b.roughness, 0.3, 0.01);
    CHECK_NEAR(b.specular, 0.5, 0.01);
}

/* What is darker than the mean material allows becomes diffuse by degrees: no threshold on which noise decides. */
static void test_unobserved(void) {
    struct specular_posterior nothing = specular_posterior_unobserved(0.0), last = nothing;
    CHECK(nothing.roughness == (double)SPECULAR_UNKNOWN_ROUGHNESS);
    CHECK(nothing.specular == (double)SPECULAR_UNKNOWN_SPECULAR);
    CHECK(specular_posterior_unobserved(9.0).specular == nothing.specular);
    for (int i = 1; i <= 60; i++) {
        struct specular_posterior next = specular_posterior_unobserved(-0.1 * i);
        CHECK(next.diffuse > last.diffuse && next.diffuse < last.diffuse + 0.06);
        CHECK(next.roughness > last.roughness && next.roughness < last.roughness + 0.04);
        CHECK(next.specular < last.specular && next.specular > last.specular - 0.02);
        last = next;
    }
    CHECK(last.diffuse > 0.99 && last.specular < 0.001);
    CHECK(specular_posterior_unobserved(-1.0).specular > 0.22);  /* as many a black glossy thing */
    CHECK(specular_posterior_unobserved(-2.74).specular < 0.05); /* bathroom's black bars before its lit window */
}

int main(void) {
    test_alone();
    test_between();
    test_together();
    test_influence();
    test_contradiction();
    test_many();
    test_unobserved();
    return check_result();
}
