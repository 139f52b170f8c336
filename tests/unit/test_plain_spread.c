/* plain_spread.h: a known spread is read off plain charts whatever else is textured, little surface tells none; and
 * what materials_deviation states with it covers errors as a normal distribution does. */
#include "server/material/plain_spread.h"

#include "common/image.h"
#include "common/mem.h"
#include "server/scene/materials.h"
#include "tests/check.h"
#include "tests/unit/normal.h"

#define SIDE 256
#define TEXELS (SIDE * SIDE)
#define CELL 4    /* texels: 1/64 of the side */
#define CHARTS 8  /* columns of the texture, each of one triangle and segment */
#define EMITTER 7 /* the last one */
#define COLOR 0.5f

static uint32_t triangle[TEXELS], valid[TEXELS], of_triangle[CHARTS] = {0, 1, 2, 3, 4, 5, 6, 7};
static float observed[TEXELS];
static const struct atlas atlas = {
    .width = SIDE, .height = SIDE, .chart_count = CHARTS, .chart_of_triangle = of_triangle};
static const struct segments segments = {.count = CHARTS, .of_triangle = of_triangle};
static struct inverse_uv inverse = {.width = SIDE, .height = SIDE, .triangle = triangle, .valid = valid};
static const struct surface surface = {NULL, &segments, &atlas, &inverse};
static const bool is_emitter[CHARTS] = {[EMITTER] = true};
static struct materials materials;

static uint32_t chart_at(uint32_t texel) { return texel % SIDE / (SIDE / CHARTS); }

static uint32_t cell_at(uint32_t texel) { return texel / SIDE / CELL * (SIDE / CELL) + texel % SIDE / CELL; }

static void make_surface(void) {
    for (uint32_t i = 0; i < TEXELS; i++) {
        triangle[i] = chart_at(i);
        valid[inverse.valid_count++] = i;
        observed[i] = 1.0f;
    }
    materials_init(&materials, &inverse, CHARTS, rgb_gray(COLOR), 1.0f, 0.0f);
    materials_start_deviation(&materials);
}

static void set(uint32_t texel, float value) {
    for (int c = 0; c < 3; c++)
        materials.base_color.texel[texel][c] = value;
}

static float measure(void) { return plain_spread(&surface, &materials.base_color, observed, is_emitter); }

/* Each chart has a colour of its own, and its cells `spread` about it; the first `textured` charts have broad stripes,
 * the emitter as well. */
static void paint(float spread, uint32_t textured) {
    for (uint32_t i = 0; i < TEXELS; i++) {
        uint32_t chart = chart_at(i);
        float stripe = (chart < textured || chart == EMITTER) && i / SIDE / 16 % 2 ? 0.4f : 1.0f;
        set(i, (0.2f + 0.05f * (float)chart) * stripe * expf(spread * normal(1, cell_at(i))));
    }
}

static void test_spread(void) {
    const float spread[] = {0.002f, 0.01f, 0.05f};
    for (size_t k = 0; k < sizeof spread / sizeof *spread; k++) {
        paint(spread[k], 0);
        CHECK_NEAR(measure() / spread[k], 1.0, 0.06);
        paint(spread[k], 2); /* of seven: outliers */
        CHECK_THAT(measure() > spread[k] && measure() < 1.8f * spread[k], "%g of %g beside textures", (double)measure(),
                   (double)spread[k]);
    }
}

/* Texels that no photograph shows count neither as surface nor in the mean of a cell that has others. */
static void test_little_is_seen(void) {
    paint(0.01f, 0);
    for (uint32_t i = 0; i < TEXELS; i++)
        observed[i] = i / SIDE % 2 ? 1.0f : 0.0f;
    for (uint32_t i = 0; i < TEXELS; i++)
        if (!(observed[i] > 0.0f))
            set(i, 0.9f * normal(5, i));
    CHECK_NEAR(measure() / 0.01f, 1.0, 0.06);
    for (uint32_t i = 0; i < TEXELS; i++)
        observed[i] = i / SIDE < 3 * CELL && chart_at(i) == 0 ? 1.0f : 0.0f;
    CHECK_THAT(isnan(measure()), "%g of 24 cells", (double)measure());
    for (uint32_t i = 0; i < TEXELS; i++)
        observed[i] = 1.0f;
}

/* Errors of a known variance: along plain surface one of .01 that cells share and no measurement tells; on every fourth
 * cell noise of .03 of each texel, which its measurement tells. */
static void test_coverage(void) {
    size_t one = 0, two = 0;
    for (uint32_t i = 0; i < TEXELS; i++) {
        bool is_noisy = cell_at(i) % 4 == 0;
        set(i, COLOR * expf(0.01f * normal(2, cell_at(i))) + (is_noisy ? 0.03f * normal(3, i) : 0.0f));
        materials.deviation[i] = image_half_from_float(is_noisy ? 0.03f : 0.001f);
    }
    materials.spread = measure();
    for (uint32_t i = 0; i < TEXELS; i++) {
        float off = fabsf(materials.base_color.texel[i][1] - COLOR), stated = materials_deviation(&materials, i).g;
        one += off <= stated;
        two += off <= 2.0f * stated;
    }
    double share = (double)one / TEXELS, within_two = (double)two / TEXELS;
    CHECK_THAT(share > 0.6 && share < 0.75 && within_two > 0.9 && within_two < 0.98,
               "%.3f of the errors are within one deviation, %.3f within two", share, within_two);
    materials.deviation[0] = 0;
    CHECK(rgb_is_black(materials_deviation(&materials, 0))); /* unknown */
}

int main(void) {
    make_surface();
    test_spread();
    test_little_is_seen();
    test_coverage();
    materials_release(&materials);
    return check_result();
}
