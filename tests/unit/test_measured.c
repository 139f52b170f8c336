/* measured.h: a look of much weight counts for much where the others do not contradict it; into a highlight that none of
 * the others shows it does not, however sharp it is. */
#include "server/material/measured.h"

#include <math.h>

#include "tests/check.h"

#define LOOKS 10
#define SCALE 0.3f

/* LOOKS - 1 of the value `dark`, more or less, and one of so much more weight of the value `other`. */
static float mean_with(float dark, float other, float weight) {
    struct measured_looks looks = {.count = LOOKS};
    for (int i = 0; i < LOOKS; i++) {
        float value = i == 0 ? other : dark * (1.0f + 0.02f * (float)(i - LOOKS / 2));
        looks.look[i] = (struct robust_sample){.value = rgb_gray(value), .gray = logf(value), .deviation = 0.05f,
                                               .weight = i == 0 ? weight : 1.0f, .source = (uint32_t)i};
    }
    struct measured m = measured_mean(&looks, SCALE, rgb_gray(0.0f));
    return rgb_mean(measured_value(&m));
}

int main(void) {
    CHECK_NEAR(mean_with(0.1f, 0.1f, 1.0f), 0.1f, 0.002f);
    CHECK_NEAR(mean_with(0.1f, 0.12f, 50.0f), 0.117f, 0.003f);
    CHECK_NEAR(mean_with(0.1f, 2.0f, 50.0f), 0.1f, 0.15f); /* as the one that saw most: 2 */
    return check_result();
}
