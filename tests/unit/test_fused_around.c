/* fused_around: the mean of a texel's neighbours in its own chart, by how many photographs measured them; what is only
 * a bound, or was not seen, does not count. */
#include "server/capture/fuse.h"
#include "tests/check.h"
#include "tests/unit/surface.h"

static uint32_t chart_of_triangle[2] = {0, 1};
static const struct atlas atlas = {
    .width = SIDE, .height = SIDE, .chart_count = 2, .chart_of_triangle = chart_of_triangle};
static uint16_t radiance[TEXELS][3];
static float count[TEXELS];
static bool is_bound[TEXELS];
static const struct fused fused = {
    .width = SIDE, .height = SIDE, .radiance = radiance, .count = count, .is_bound = is_bound};

static void show(uint32_t texel, float value, float times) {
    for (size_t c = 0; c < 3; c++)
        radiance[texel][c] = image_half_from_float(value);
    count[texel] = times;
}

static float around(uint32_t texel, uint32_t reach) {
    rgb mean = fused_around(&fused, &atlas, &inverse, texel, reach);
    CHECK(mean.r == mean.g && mean.g == mean.b);
    return mean.r;
}

int main(void) {
    (void)segments;
    make_surface();
    for (uint32_t i = 0; i < TEXELS; i++)
        show(i, i % SIDE < SIDE / 2 ? 1.0f : 64.0f, 1.0f);
    uint32_t middle = 4 * SIDE + 2; /* the other chart begins two texels to the right */
    show(middle, 4.0f, 1.0f);
    CHECK_NEAR(around(middle, 0), 4.0f, 0.0f);
    CHECK_NEAR(around(middle, 1), (4.0f + 8.0f) / 9.0f, 1e-6f);
    CHECK_NEAR(around(middle, 2), (4.0f + 19.0f) / 20.0f, 1e-6f);
    show(middle, 4.0f, 3.0f);
    CHECK_NEAR(around(middle, 1), (12.0f + 8.0f) / 11.0f, 1e-6f);
    is_bound[middle - 1] = true;
    show(middle - 1, 100.0f, 1.0f);
    show(middle + 1, 100.0f, 0.0f);
    CHECK_NEAR(around(middle, 1), (12.0f + 6.0f) / 9.0f, 1e-6f);
    CHECK_NEAR(around(0, 1), 1.0f, 1e-6f); /* the corner of the atlas */
    CHECK_NEAR(around(TEXELS - 2, SIDE), 64.0f, 1e-6f);
    return check_result();
}
