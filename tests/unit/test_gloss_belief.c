/* gloss_belief.h: what segments of one colour tell of each other, and when they do not. */
#include "server/material/gloss_belief.h"

#include <math.h>

#include "tests/check.h"

#define SMALL 0.002
#define LARGE 0.2

static const rgb white = {0.85f, 0.85f, 0.85f}, brown = {0.4f, 0.2f, 0.1f};

/* A segment whose photographs show a candidate's gloss, others being off by the distance between the roughnesses over
 * `error` standard errors, and specular in the same way. */
static struct gloss_told told(double part, rgb color, double roughness, double specular, double error) {
    struct gloss_told t = {.any = true, .part = part, .base_color = color, .best_roughness = roughness};
    double most = -1.0;
    for (size_t k = 0; k < HIGHLIGHT_ROUGHNESSES; k++) {
        for (size_t m = 0; m < HIGHLIGHT_SPECULARS; m++) {
            size_t c = gloss_candidate(k, m);
            double r = (double)gloss_levels.roughness[k] - roughness, s = (double)gloss_levels.specular[m] - specular;
            t.likelihood[c] = exp(-0.5 * (r * r + s * s) / (error * error));
            if (t.likelihood[c] > most)
                t.best = c, most = t.likelihood[c];
        }
    }
    t.likelihood[GLOSS_MATT] = exp(-0.5 * ((1.0 - roughness) * (1.0 - roughness) + specular * specular) / (error * error));
    return t;
}

static void test_alone(void) {
    struct gloss_told one[] = {told(SMALL, white, 0.3, 0.5, 0.05)};
    struct gloss_belief b = gloss_believe(one, 1, 0);
    CHECK(b.matt < 1e-6);
    CHECK_NEAR(b.roughness, 0.3, 0.03);
    CHECK_NEAR(b.specular, 0.5, 0.02);
    one[0] = told(SMALL, white, 1.0, 0.0, 0.05);
    CHECK(gloss_believe(one, 1, 0).matt > 0.99);
    one[0] = told(SMALL, white, 0.5, 0.5, 100.0); /* photographs tell nothing: what is common */
    b = gloss_believe(one, 1, 0);
    CHECK_NEAR(b.matt, 0.36, 0.01);
    CHECK_NEAR(b.specular / (1.0 - b.matt), 0.54, 0.02);
}

/* Where the best candidate is the only one, it is what lies between the levels. */
static void test_between(void) {
    struct gloss_told one[] = {told(SMALL, white, 0.45, 0.5, 0.01)};
    one[0].best_roughness = 0.43;
    CHECK_NEAR(gloss_believe(one, 1, 0).roughness, 0.43, 1e-4);
}

/* Four that can hardly be told from matt, each by itself, and can together. */
static void test_together(void) {
    struct gloss_told four[] = {told(SMALL, white, 0.4, 0.5, 0.5), told(SMALL, white, 0.4, 0.5, 0.5),
                                told(SMALL, white, 0.4, 0.5, 0.5), told(SMALL, white, 0.4, 0.5, 0.5)};
    double alone = gloss_believe(four, 1, 0).matt, last = alone;
    CHECK(alone > 0.1);
    for (size_t count = 2; count <= 4; count++) {
        double matt = gloss_believe(four, count, 0).matt;
        CHECK(matt < last);
        last = matt;
    }
    CHECK(last < 0.6 * alone);
}

/* One that is sure moves one that is not, unless it is of another colour, large, or nothing is told of it; what is sure is
 * not moved. */
static void test_who_is_heard(void) {
    struct gloss_told pair[] = {told(SMALL, white, 0.5, 0.3, 0.6), told(SMALL, white, 0.2, 0.5, 0.03)};
    struct gloss_belief alone = gloss_believe(pair, 1, 0), with = gloss_believe(pair, 2, 0);
    CHECK(with.matt < 0.5 * alone.matt && with.roughness < alone.roughness - 0.1);
    struct gloss_belief sure = gloss_believe(pair, 2, 1), sure_alone = gloss_believe(pair + 1, 1, 0);
    CHECK_NEAR(sure.roughness, sure_alone.roughness, 0.01);
    struct gloss_told other = pair[1];
    pair[1].base_color = brown;
    CHECK_NEAR(gloss_believe(pair, 2, 0).roughness, alone.roughness, 1e-12);
    pair[1] = other, pair[1].part = LARGE;
    CHECK_NEAR(gloss_believe(pair, 2, 0).roughness, alone.roughness, 1e-12);
    pair[1] = other, pair[1].any = false;
    CHECK_NEAR(gloss_believe(pair, 2, 0).roughness, alone.roughness, 1e-12);
    pair[1] = other, pair[1].base_color = rgb_gray(0.95f); /* nearly the same colour moves it nearly as far */
    struct gloss_belief near = gloss_believe(pair, 2, 0);
    CHECK(near.roughness > with.roughness && near.roughness < alone.roughness - 0.05);
}

/* Two of one colour that contradict each other both stay what they are. */
static void test_contradiction(void) {
    struct gloss_told pair[] = {told(SMALL, white, 0.15, 0.5, 0.03), told(SMALL, white, 1.0, 0.0, 0.03)};
    CHECK_NEAR(gloss_believe(pair, 2, 0).roughness, 0.15, 0.02);
    CHECK(gloss_believe(pair, 2, 1).matt > 0.99);
}

/* However many of one colour there are, and however sure each is. */
static void test_many(void) {
    struct gloss_told many[200];
    for (size_t i = 0; i < 200; i++)
        many[i] = told(SMALL, white, 0.3, 0.5, 0.02);
    struct gloss_belief b = gloss_believe(many, 200, 7);
    CHECK_NEAR(b.roughness, 0.3, 0.01);
    CHECK_NEAR(b.specular, 0.5, 0.01);
}

int main(void) {
    test_alone();
    test_between();
    test_together();
    test_who_is_heard();
    test_contradiction();
    test_many();
    return check_result();
}
