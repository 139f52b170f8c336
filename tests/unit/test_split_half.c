/* split_half.h and robust.h: draws are as far from 0 as means are from the truth, whatever all samples share; and an
 * outlier is told from noise. */
#include "server/capture/split_half.h"

#include "tests/check.h"
#include "tests/unit/normal.h"

#define MEANS 4096
#define SAMPLES 7
#define TRUTH 0.4f

/* Samples of photographs that are the noisier the later; noise of up to a third. Sharpness may differ, weights do. */
static void measure(struct robust_sample sample[SAMPLES], uint32_t mean, bool same_sharpness) {
    for (uint32_t i = 0; i < SAMPLES; i++) {
        float deviation = 0.05f + 0.04f * (float)i, value = TRUTH * (1.0f + deviation * normal(i, mean));
        sample[i] = (struct robust_sample){.value = rgb_gray(value),
                                           .deviation = deviation,
                                           .weight = i % 2 ? 1.0f : 3.0f, /* not the best ones */
                                           .source = i,
                                           .sharp = same_sharpness ? 1.0f : 1.0f / (float)(i + 1)};
    }
}

static rgb mean_of(const struct robust_sample sample[SAMPLES]) {
    rgb sum = {0.0f, 0.0f, 0.0f};
    float weights = 0.0f;
    for (uint32_t i = 0; i < SAMPLES; i++) {
        sum = rgb_mad(sum, sample[i].weight, sample[i].value);
        weights += sample[i].weight;
    }
    return rgb_scale(sum, 1.0f / weights);
}

/* Of MEANS squares the mean is known to 2.2 % (one standard error); four of them. */
static void test_variance(bool same_sharpness) {
    double errors = 0.0, draws = 0.0;
    for (uint32_t i = 0; i < MEANS; i++) {
        struct robust_sample sample[SAMPLES];
        rgb draw;
        measure(sample, i, same_sharpness);
        CHECK(split_half_draw(sample, SAMPLES, &draw));
        double off = (double)(mean_of(sample).g - TRUTH);
        errors += off * off;
        draws += (double)(draw.g * draw.g);
    }
    CHECK_THAT(fabs(draws / errors - 1.0) < 4.0 * 0.032, "draws have %.3f of the power of errors", draws / errors);
}

/* What all photographs show is no noise, whether they are as sharp as each other or not. */
static void test_what_they_share(void) {
    struct robust_sample sample[SAMPLES];
    rgb draw;
    measure(sample, 0, true);
    for (uint32_t i = 0; i < SAMPLES; i++)
        sample[i].value = rgb_make(0.1f, 0.9f, 0.5f);
    CHECK(split_half_draw(sample, SAMPLES, &draw));
    CHECK_NEAR(rgb_dot(draw, draw), 0.0, 1e-12);
    for (uint32_t i = 0; i < SAMPLES; i++) { /* those from far away are gray, and not asked */
        sample[i].sharp = i < 3 ? 1.0f : 0.1f;
        if (i >= 3)
            sample[i].value = rgb_gray(0.5f);
    }
    CHECK(split_half_draw(sample, SAMPLES, &draw));
    CHECK_NEAR(rgb_dot(draw, draw), 0.0, 1e-12);
}

static void test_alone(void) {
    struct robust_sample sample[SAMPLES];
    rgb draw = {1.0f, 2.0f, 3.0f};
    measure(sample, 0, true);
    CHECK(!split_half_draw(sample, 1, &draw) && draw.b == 3.0f);
    for (uint32_t i = 0; i < SAMPLES; i++)
        sample[i].deviation = 0.0f;
    CHECK(!split_half_draw(sample, SAMPLES, &draw) && draw.b == 3.0f);
    measure(sample, 0, true);
    sample[0].sharp = 100.0f; /* nothing is as sharp: better to ask the others than nobody */
    CHECK(split_half_draw(sample, SAMPLES, &draw) && draw.b != 3.0f);
}

/* The same value far off: to be expected of a noisy photograph, and then it counts; an outlier among clean ones. */
static void test_outlier(void) {
    struct robust_sample sample[SAMPLES];
    for (int noisy = 0; noisy < 2; noisy++) {
        for (uint32_t i = 0; i < SAMPLES; i++) {
            float value = i < SAMPLES - 1 ? 1.0f : 3.0f;
            sample[i] = (struct robust_sample){
                .value = rgb_gray(value), .gray = logf(value), .weight = 1.0f, .deviation = noisy ? 1.0f : 0.01f};
        }
        rgb mean = robust_mean(sample, SAMPLES, 0.3f);
        if (noisy)
            CHECK_THAT(mean.g > 1.2f, "%.3f", (double)mean.g); /* 1.29 were it counted in full */
        else
            CHECK_THAT(mean.g < 1.03f, "%.3f", (double)mean.g);
    }
}

/* What most show is kept, though others weigh more. */
static void test_keep(void) {
    const float value[] = {0.9f, 0.02f, 1.1f, 0.03f, 1.0f};
    struct robust_sample sample[5];
    for (uint32_t i = 0; i < 5; i++)
        sample[i] =
            (struct robust_sample){.gray = logf(value[i]), .weight = value[i] < 0.5f ? 10.0f : 1.0f, .source = i};
    CHECK(robust_select(sample, 5, 0.7f) == 3);
    CHECK(sample[0].source == 0 && sample[1].source == 4 && sample[2].source == 2);
    CHECK(robust_select(sample, 1, 0.7f) == 1);
}

int main(void) {
    test_keep();
    test_variance(true);
    test_variance(false);
    test_what_they_share();
    test_alone();
    test_outlier();
    return check_result();
}
