/* Bilinear look-ups in a photograph: places, borders, saturation, masks, damaged pixels. */
#include "server/scene/photograph.h"

#include "common/image.h"
#include "common/mem.h"
#include "tests/check.h"

/* Small whole numbers and halves as IEEE half, by hand: sign 0, bias 15. */
#define H0 0x0000
#define H025 0x3400
#define H1 0x3c00
#define H2 0x4000
#define H_INF 0x7c00
#define H_NAN 0x7e00
#define H_SUBNORMAL 0x0001 /* 2^-24 */

static struct photograph make(void) {
    /* 3 x 2, red = column, green = 1 in the lower row, blue = 0.25 */
    struct photograph p = {
        .exposure = 1.0f, .gain = {1.0f, 1.0f, 1.0f}, .clip = INFINITY, .camera = {.width = 3, .height = 2}};
    p.pixel = mem_calloc(6, sizeof *p.pixel);
    static const uint16_t red[3] = {H0, H1, H2};
    for (int i = 0; i < 6; i++) {
        p.pixel[i][0] = red[i % 3];
        p.pixel[i][1] = i >= 3 ? H1 : H0;
        p.pixel[i][2] = H025;
    }
    return p;
}

/* A cubic look-up reads pixels as they are and straight lines between them, parabolas too away from the
 * border, and keeps more of a fine pattern than a bilinear one; it wants all its taps. */
static void test_cubic(void) {
    struct photograph p = {
        .exposure = 2.0f, .gain = {1.0f, 1.0f, 0.5f}, .clip = INFINITY, .camera = {.width = 12, .height = 8}};
    p.pixel = mem_calloc(96, sizeof *p.pixel);
    for (int i = 0; i < 96; i++) {
        float x = (float)(i % 12) + 0.5f, y = (float)(i / 12) + 0.5f;
        p.pixel[i][0] = image_half_from_float(x + 2.0f * y);
        p.pixel[i][1] = image_half_from_float(x * x);
        p.pixel[i][2] = image_half_from_float(i % 4 < 2 ? 0.0f : 1.0f);
    }
    rgb sharp;
    struct photograph_sample soft;
    CHECK(photograph_sample_cubic(&p, 4.25f, 3.75f, &sharp));
    CHECK_NEAR(sharp.r, 0.5 * (4.25 + 2.0 * 3.75), 1e-5);
    CHECK_NEAR(sharp.g, 0.5 * 4.25 * 4.25, 1e-4);
    CHECK(photograph_sample_cubic(&p, 4.5f, 3.5f, &sharp) && sharp.b == 0.0f);
    CHECK(photograph_sample_cubic(&p, 7.0f, 3.5f, &sharp) && photograph_sample(&p, 7.0f, 3.5f, &soft));
    CHECK(soft.radiance.b == 1.0f && sharp.b > 1.1f); /* between two that are bright */
    CHECK(!photograph_sample_cubic(&p, 1.4f, 3.5f, &sharp) && !photograph_sample_cubic(&p, 4.5f, 6.6f, &sharp));
    CHECK(photograph_sample_cubic(&p, 1.5f, 1.5f, &sharp) && photograph_sample_cubic(&p, 9.9f, 5.9f, &sharp));
    p.clip = 100.0f;
    CHECK(photograph_sample_cubic(&p, 7.0f, 3.5f, &sharp) && !photograph_sample_cubic(&p, 8.6f, 3.5f, &sharp));
    p.firefly = mem_calloc(96, sizeof *p.firefly);
    p.firefly[2 * 12 + 2] = true; /* no tap may read it */
    CHECK(!photograph_sample_cubic(&p, 3.5f, 3.5f, &sharp) && photograph_sample_cubic(&p, 7.0f, 3.5f, &sharp));
    CHECK(photograph_has_firefly(&p, 2.5f, 2.5f) && photograph_has_firefly(&p, 3.4f, 1.6f) &&
          !photograph_has_firefly(&p, 3.5f, 2.5f));
    p.mask = mem_calloc(96, 1);
    CHECK(!photograph_sample_cubic(&p, 7.0f, 3.5f, &sharp));
    photograph_release(&p);
}

/* A black pixel reads as a little less than that, in shares of look-ups too; others, however dark, as they are. */
static void test_black(void) {
    struct photograph p = {.exposure = 0.5f,
                           .gain = {1.0f, 2.0f, 1.0f},
                           .clip = 1.0f,
                           .black = 0.25f,
                           .camera = {.width = 4, .height = 4}};
    p.pixel = mem_calloc(16, sizeof *p.pixel);
    for (int i = 0; i < 16; i++)
        p.pixel[i][2] = i % 4 == 3 ? H_SUBNORMAL : H025;
    struct photograph_sample s;
    rgb sharp;
    CHECK(photograph_sample(&p, 1.5f, 1.5f, &s) && s.radiance.r == -0.5f && s.radiance.g == -0.25f &&
          s.radiance.b == 0.5f);
    CHECK(photograph_sample(&p, 3.5f, 1.5f, &s) && s.radiance.b == 0x1p-23f);
    CHECK(photograph_sample_cubic(&p, 1.75f, 2.0f, &sharp));
    CHECK_NEAR(sharp.r, -0.5, 1e-6);
    p.pixel[0][0] = H025;
    CHECK(photograph_sample(&p, 1.0f, 0.5f, &s));
    CHECK_NEAR(s.radiance.r, 0.0, 1e-6);
    photograph_release(&p);
}

int main(void) {
    test_cubic();
    test_black();
    struct photograph p = make();
    struct photograph_sample s;
    CHECK(photograph_sample(&p, 1.5f, 0.5f, &s));
    CHECK(s.radiance.r == 1.0f && s.radiance.g == 0.0f && s.radiance.b == 0.25f);
    CHECK(isinf(s.clip_radiance.r) && !s.saturated[0]);
    CHECK(photograph_sample(&p, 1.75f, 0.75f, &s));
    CHECK_NEAR(s.radiance.r, 1.25, 1e-6);
    CHECK_NEAR(s.radiance.g, 0.25, 1e-6);
    /* Within half a pixel of the border the border's pixel goes on. */
    CHECK(photograph_sample(&p, 0.0f, 0.0f, &s) && s.radiance.r == 0.0f && s.radiance.g == 0.0f);
    CHECK(photograph_sample(&p, 2.999f, 1.999f, &s) && s.radiance.r == 2.0f && s.radiance.g == 1.0f);

    p.exposure = 0.5f;
    p.gain = rgb_make(1.0f, 2.0f, 1.0f);
    p.clip = 1.0f;
    CHECK(photograph_sample(&p, 0.75f, 1.5f, &s));
    CHECK_NEAR(s.radiance.r, 0.5, 1e-6);
    CHECK_NEAR(s.radiance.g, 1.0, 1e-6);
    CHECK(s.saturated[0] && s.saturated[1] && !s.saturated[2]); /* a tap of red 1, all of green 1 */
    CHECK_NEAR(s.clip_radiance.r, 2.0, 1e-6);
    CHECK_NEAR(s.clip_radiance.g, 1.0, 1e-6);
    CHECK(photograph_sample(&p, 0.5f, 0.5f, &s) && !s.saturated[0]); /* the neighbour has no weight */

    /* The vignette is divided out, of the clip too: a corner saturates at more radiance. */
    p.camera.cx = 1.5f;
    p.camera.cy = 1.0f;
    p.vignette[0] = -0.25f;
    p.vignette[1] = -0.5f;
    double corner = (double)photograph_radius(&p, 2.5f, 1.5f); /* (1 + 0.25) / (2.25 + 1) */
    double left = exp(-0.25 * corner - 0.5 * corner * corner);
    CHECK_NEAR(corner, 1.25 / 3.25, 1e-6);
    CHECK_NEAR(photograph_radius(&p, 3.0f, 2.0f), 1.0, 1e-6);
    CHECK(photograph_sample(&p, 2.5f, 1.5f, &s) && s.saturated[0]);
    CHECK_NEAR(s.radiance.r, 4.0 / left, 1e-5);
    CHECK_NEAR(s.radiance.b, 0.5 / left, 1e-5);
    CHECK_NEAR(s.clip_radiance.r, 2.0 / left, 1e-5);
    CHECK(photograph_falloff(&p, 1.5f, 1.0f) == 1.0f);
    memset(p.vignette, 0, sizeof p.vignette);

    p.mask = mem_calloc(6, 1);
    memset(p.mask, 255, 6);
    p.mask[1] = 0;
    CHECK(!photograph_sample(&p, 0.75f, 0.5f, &s));
    CHECK(photograph_sample(&p, 0.5f, 0.5f, &s));
    p.pixel[3][1] = H_NAN;
    CHECK(!photograph_sample(&p, 0.5f, 0.9f, &s));
    p.pixel[3][1] = H_INF;
    CHECK(!photograph_sample(&p, 0.5f, 0.9f, &s));
    p.pixel[3][1] = H_SUBNORMAL;
    p.exposure = 0x1p-20f;
    CHECK(photograph_sample(&p, 0.5f, 1.5f, &s) && s.radiance.g == 0x1p-5f);
    photograph_release(&p);
    CHECK(p.pixel == NULL && p.mask == NULL);
    return check_result();
}
