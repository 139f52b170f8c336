/* adam.h: touched entries move as Algorithm 1 says, untouched ones not at all. */
#include "server/refine/adam.h"

#include "tests/check.h"

int main(void) {
    struct adam a;
    adam_init(&a, 3, 2, 0.9f, 0.999f);
    float step[2];
    /* First touch: mean and square are corrected to the gradient itself, so the step is -sign. */
    adam_touch(&a, 1, (float[]){0.25f, -4.0f}, step);
    CHECK_NEAR(step[0], -1.0, 1e-5);
    CHECK_NEAR(step[1], 1.0, 1e-5);
    CHECK(adam_touches(&a, 0) == 0.0f && adam_touches(&a, 1) == 1.0f);
    /* Second touch, by hand: mean (0.9*0.1*g1 + 0.1*g2) / (1 - 0.81), square alike. */
    adam_touch(&a, 1, (float[]){0.75f, 0.0f}, step);
    double mean = (0.9 * 0.1 * 0.25 + 0.1 * 0.75) / (1 - 0.81);
    double square = (0.999 * 0.001 * 0.0625 + 0.001 * 0.5625) / (1 - 0.999 * 0.999);
    CHECK_NEAR(step[0], -mean / sqrt(square), 1e-4);
    /* A gradient of zero from the start is no direction. */
    adam_touch(&a, 2, (float[]){0.0f, 0.0f}, step);
    CHECK(step[0] == 0.0f && step[1] == 0.0f);
    /* It finds the minimum of a quadratic with a falling rate. */
    float x = 0.0f;
    adam_reset(&a, 0, 3);
    for (int i = 0; i < 400; i++) {
        float g[2] = {2.0f * (x - 0.7f), 0.0f};
        adam_touch(&a, 0, g, step);
        x += 0.05f / (1.0f + 0.05f * (float)i) * step[0];
    }
    CHECK_NEAR(x, 0.7, 0.01);
    adam_release(&a);
    return check_result();
}
