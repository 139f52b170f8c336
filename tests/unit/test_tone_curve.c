/* tone_curve.h: the basis is orthonormal over encoded values, stored values are found again from straight ones, a
 * curve that falls is refused, and pixels are straightened once. */
#include "server/capture/tone_curve.h"

#include <math.h>
#include <string.h>

#include "common/image.h"
#include "tests/check.h"

static struct tone_table table;

/* Over 201 encoded values from .08 to .98. */
static void test_basis(void) {
    double product[TONE_TERMS][TONE_TERMS] = {{0.0}}, mean[TONE_TERMS] = {0.0}, basis[TONE_TERMS];
    for (int i = 0; i <= 200; i++) {
        tone_basis(&table, log((double)image_srgb_to_linear(0.08f + 0.0045f * (float)i)), basis);
        for (int a = 0; a < TONE_TERMS; a++) {
            mean[a] += basis[a] / 201.0;
            for (int b = 0; b < TONE_TERMS; b++)
                product[a][b] += basis[a] * basis[b] / 201.0;
        }
    }
    for (int a = 0; a < TONE_TERMS; a++) {
        CHECK_NEAR(mean[a], 0.0, 0.05);
        for (int b = 0; b < TONE_TERMS; b++)
            CHECK_NEAR(product[a][b], a == b ? 1.0 : 0.0, 0.1); /* at other places than the basis was made at */
    }
    double dark[TONE_TERMS], darker[TONE_TERMS];
    tone_basis(&table, -6.2, dark);
    tone_basis(&table, -20.0, darker);
    CHECK(memcmp(dark, darker, sizeof dark) == 0);
}

static void test_straight(void) {
    const struct tone_curve curve = {{-0.276, 0.046, 0.027, 0.003}}, falls = {{-1.0, 0.5, 0.0, 0.0}};
    CHECK(tone_table_set(&table, &curve));
    CHECK(!tone_table_set(&table, &falls));
    for (double s = -9.0; s < 1.0; s += 0.037) {
        double basis[TONE_TERMS], expected = s;
        tone_basis(&table, s, basis);
        for (int k = 0; k < TONE_TERMS; k++)
            expected += curve.term[k] * basis[k];
        CHECK_NEAR(tone_straight(&table, s), expected, 1e-9);
        CHECK_NEAR(tone_stored(&table, tone_straight(&table, s)), s, 1e-9);
    }
}

#define WIDTH 4

static void test_pixels(void) {
    static const float value[WIDTH] = {0.0f, 0.01f, 0.25f, 1.0f};
    uint16_t pixel[3][WIDTH][3];
    struct photograph photo[3];
    for (int p = 0; p < 3; p++) {
        photo[p] = (struct photograph){.is_hdr = p == 1, .is_straight = p == 2, .clip = p == 1 ? INFINITY : 1.0f};
        photo[p].camera.width = WIDTH, photo[p].camera.height = 1;
        photo[p].pixel = pixel[p];
        for (int i = 0; i < WIDTH; i++)
            for (int c = 0; c < 3; c++)
                pixel[p][i][c] = image_half_from_float(value[i]);
    }
    struct scene scene = {.photograph = photo, .photograph_count = 3};
    tone_straighten(&table, &scene);
    CHECK(pixel[0][0][0] == 0);
    for (int i = 1; i < WIDTH; i++) {
        double expected = exp(tone_straight(&table, log((double)value[i])));
        CHECK_NEAR(image_float_from_half(pixel[0][i][2]), expected, 1e-3 * expected);
    }
    CHECK(photo[0].clip == image_float_from_half(pixel[0][3][0]) && photo[0].is_straight);
    CHECK(memcmp(pixel[1], pixel[2], sizeof pixel[1]) == 0 && pixel[1][3][0] == image_half_from_float(1.0f));
    CHECK(isinf(photo[1].clip) && photo[2].clip == 1.0f && !photo[1].is_straight);
}

int main(void) {
    tone_table_init(&table);
    test_basis();
    test_straight();
    test_pixels();
    return check_result();
}
