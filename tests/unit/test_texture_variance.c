/* texture_variance.h: of texels with noise of known variances, a few a hundred times less than the others, what their
 * colours vary by beyond it; of a plain chart nothing; and the weights that follow. */
#include "server/material/texture_variance.h"

#include "common/image.h"
#include "common/mem.h"
#include "tests/check.h"
#include "tests/unit/normal.h"

#define SIDE 128
#define TEXELS (SIDE * SIDE)
#define UNDERSTATED 1.25f /* the square of what noise is scaled by */

/* Two charts: the upper half and the lower one. */
static uint32_t triangle[TEXELS], valid[TEXELS], chart_of_triangle[2] = {0, 1};
static const struct atlas atlas = {
    .width = SIDE, .height = SIDE, .chart_count = 2, .chart_of_triangle = chart_of_triangle};
static const struct inverse_uv inverse = {
    .width = SIDE, .height = SIDE, .triangle = triangle, .valid_count = TEXELS, .valid = valid};

int main(void) {
    static struct measurement measured[TEXELS];
    const float texture = 0.2f, noise = 0.1f; /* standard deviations, by channel */
    for (uint32_t i = 0; i < TEXELS; i++) {
        float own = i % 64 == 0 ? 0.01f * noise : noise;
        triangle[i] = i < TEXELS / 2 ? 0 : 1;
        valid[i] = i;
        measured[i] = (struct measurement){.weight = 1.0f / (own * own)};
        for (uint32_t c = 0; c < 3; c++) {
            float value =
                0.5f + (triangle[i] == 0 ? texture * normal(1, i) : 0.0f) + sqrtf(UNDERSTATED) * own * normal(2 + c, i);
            measured[i].value[c] = image_half_from_float(value);
            measured[i].noise[c] = image_half_from_float(own * normal(5 + c, i));
        }
    }
    struct texture_variance *v = texture_variances(&atlas, &inverse, measured);
    float wanted = 3.0f * texture * texture;
    CHECK_NEAR(v[0].texture, wanted, 0.05f * wanted); /* 8,192 texels: a relative error of .016 */
    CHECK_NEAR(v[0].noise, 3.0f, 0.1f);
    CHECK_THAT(v[1].texture < 0.003f, "%g", (double)v[1].texture); /* a tenth of the noise */
    float certain = texture_variance_weight(&v[0], 1.0f / (1e-4f * noise * noise), 0.0f),
          usual = texture_variance_weight(&v[0], 1.0f / (noise * noise), 0.0f);
    CHECK_NEAR(certain / usual, (texture * texture + noise * noise) / (texture * texture), 0.05f);
    float mixed = texture_variance_weight(&v[0], 1.0f / (noise * noise), 3.0f * noise * noise);
    CHECK_NEAR(usual / mixed, (texture * texture + 2.0f * noise * noise) / (texture * texture + noise * noise), 0.05f);
    mem_free(v);
    return check_result();
}
