/* robust.h: weights in closed form: half at the distance of `scale`, or where noise alone goes that far; a share of
 * wrong samples that moves the mean by what the formula says and not more; the median by weights to a power; and how
 * much of normal noise's information one step with Cauchy's weights keeps. */
#include "server/capture/robust.h"

#include "tests/check.h"
#include "tests/unit/normal.h"

#define SAMPLES 41
#define SCALE 0.3f

static struct robust_sample sample_of(float value, float weight, float deviation) {
    return (struct robust_sample){
        .value = rgb_make(value, 2.0f * value, 0.0f), .gray = logf(value), .weight = weight, .deviation = deviation};
}

/* The weight of the one of 9 samples that is off by so much in its logarithm. */
static float weight_off(float off, float deviation, float scale) {
    struct robust_sample sample[9];
    for (int i = 0; i < 9; i++)
        sample[i] = sample_of(i == 0 ? expf(off) : 1.0f, 2.0f, deviation);
    float sum = robust_weigh(sample, 9, 1.0f, scale);
    int last = off > 0.0f ? 8 : 0; /* they are sorted */
    CHECK_NEAR(sample[8 - last].weight, 2.0f, 1e-5f);
    CHECK_NEAR(sum, 16.0f + sample[last].weight, 1e-4f);
    return sample[last].weight;
}

static void test_weights(void) {
    CHECK_NEAR(weight_off(SCALE, 0.0f, SCALE), 1.0f, 1e-5f);
    CHECK_NEAR(weight_off(-SCALE, 0.0f, SCALE), 1.0f, 1e-5f);
    CHECK_NEAR(weight_off(3.0f * SCALE, 0.0f, SCALE), 0.2f, 1e-5f);
    CHECK_NEAR(weight_off(2.385f * 0.4f, 0.4f, 1e-6f), 1.0f, 1e-4f);
    CHECK_NEAR(weight_off(0.5f, 0.4f, SCALE), 2.0 / (1.0 + 0.25 / (0.09 + 2.385 * 2.385 * 0.16)), 1e-4f);
}

/* `wrong` of SAMPLES show five times as much. */
static void test_contaminated(int wrong) {
    struct robust_sample sample[SAMPLES];
    for (int i = 0; i < SAMPLES; i++)
        sample[i] = sample_of(i < wrong ? 1.0f : 0.2f, 1.0f, 0.0f);
    double apart = log(5.0), left = 1.0 / (1.0 + apart * apart / (0.3 * 0.3)), good = SAMPLES - wrong;
    rgb mean = robust_mean(sample, SAMPLES, SCALE);
    CHECK_NEAR(mean.r, (0.2 * good + 1.0 * wrong * left) / (good + wrong * left), 1e-5);
    CHECK_NEAR(mean.g, 2.0f * mean.r, 1e-5f);
    CHECK(mean.b == 0.0f);
}

/* One sample of ten times the weight: it is the median by weights, and one of eleven without. */
static void test_trust(void) {
    for (int power = 0; power < 2; power++) {
        struct robust_sample sample[6];
        for (int i = 0; i < 6; i++)
            sample[i] = sample_of(i == 0 ? 4.0f : 1.0f, i == 0 ? 10.0f : 1.0f, 0.0f);
        robust_weigh(sample, 6, (float)power, SCALE);
        CHECK_NEAR(sample[5].weight, power ? 10.0 : 10.0 / (1.0 + log(4.0) * log(4.0) / 0.09), 1e-4);
        CHECK_NEAR(sample[0].weight, power ? 1.0 / (1.0 + log(4.0) * log(4.0) / 0.09) : 1.0, 1e-5);
    }
}

static void test_keep(void) {
    struct robust_sample sample[SAMPLES];
    for (int i = 0; i < SAMPLES; i++)
        sample[i] = sample_of(i % 3 == 0 ? 0.1f : i % 3 == 1 ? 1.0f : 1.2f, i % 3 == 0 ? 100.0f : 1.0f, 0.0f);
    size_t kept = robust_select(sample, SAMPLES, 0.5f);
    CHECK(kept == 27);
    for (size_t i = 0; i < kept; i++)
        CHECK(sample[i].weight == 1.0f);
    struct robust_sample one = sample_of(3.0f, 1.0f, 0.1f);
    CHECK(robust_select(&one, 1, 0.5f) == 1);
    CHECK_NEAR(robust_mean(&one, 1, SCALE).r, 3.0f, 1e-6f);
}

#define MEANS 6000
#define FEW 201
#define DEVIATION 0.02f

/* Variance of the plain mean over that of the robust one. */
static void test_efficiency(void) {
    double plain = 0.0, robust = 0.0;
    for (uint32_t i = 0; i < MEANS; i++) {
        struct robust_sample sample[FEW];
        double sum = 0.0;
        for (uint32_t k = 0; k < FEW; k++) {
            float off = DEVIATION * normal(k, i);
            sample[k] =
                (struct robust_sample){.value = rgb_gray(off), .gray = off, .weight = 1.0f, .deviation = DEVIATION};
            sum += (double)off / FEW;
        }
        double mean = (double)robust_mean(sample, FEW, 1e-6f).r;
        plain += sum * sum;
        robust += mean * mean;
    }
    printf("efficiency %.3f\n", plain / robust);
    CHECK_NEAR(plain / robust, 0.91, 0.02);
}

int main(void) {
    test_weights();
    test_contaminated(0);
    test_contaminated(12);
    test_contaminated(20);
    test_trust();
    test_keep();
    test_efficiency();
    return check_result();
}
