/* Where the sun stands, against an almanac, and Preetham's sky against values
 * worked out by hand (sky.h). */
#include "server/relight/sky.h"

#include "server/scene/latlong.h"
#include "tests/check.h"

#define DEGREES (180.0 / PI)

/* The example of Reda and Andreas, Solar Position Algorithm (NREL/TP-560-34302,
 * 2008): 2003-10-17 12:30:30 at UTC-7. Its elevation without refraction
 * is 39.872 degrees, its azimuth 194.340. */
static void test_position(void) {
    struct sun_position s = sky_sun(2003, 10, 17, 12.0 + 30.5 / 60.0 + 7.0, 39.742476, -105.1786);
    CHECK_NEAR(s.elevation * DEGREES, 39.872, 0.02);
    CHECK_NEAR(s.azimuth * DEGREES, 194.340, 0.02);
    /* The equinox of 2024, 20 March 3:06 UTC: at noon over the equator the sun is
   * at the zenith within half a degree. */
    double rise, set;
    CHECK(sky_day(2024, 3, 20, 0.0, 0.0, &rise, &set));
    CHECK_NEAR(set - rise, 12.0, 0.05);
    CHECK_NEAR(0.5 * (rise + set), 12.0 + 7.4 / 60.0, 0.03); /* the equation of time is -7.4 minutes */
    CHECK(!sky_day(2024, 12, 21, 70.0, 20.0, &rise, &set));  /* the polar night */
    CHECK(sky_day(2024, 6, 21, 70.0, 20.0, &rise, &set) && set - rise > 23.9);
}

static void test_zenith(void) {
    struct sky sky = {.sun = {PI / 4.0, 0.0}, .turbidity = 3.0};
    double x, y, luminance;
    sky_zenith(&sky, &x, &y, &luminance);
    CHECK_NEAR(luminance, 7320.0, 5.0); /* 7.1649 tan(.65885) - .6465 + 2.4192, kcd/m2 */
    CHECK_NEAR(x, 0.2457, 2e-4);
    CHECK_NEAR(y, 0.2515, 2e-4);
    rgb c = sky_radiance(&sky, 0.0, PI / 4.0);
    CHECK_NEAR(rgb_luminance(c), luminance, 0.01 * luminance);
    CHECK(c.b > c.g && c.g > c.r);
}

/* Above the atmosphere the sun gives about 128 klx (Darula, Kittler and
 * Gueymard 2005: 133); through clear air at 45 degrees some 85, and it is
 * redder the lower it stands. */
static void test_sun(void) {
    struct sky sky = {.sun = {PI / 4.0, 0.0}, .turbidity = 2.5}, low = {.sun = {5.0 / DEGREES, 0.0}, .turbidity = 2.5};
    rgb high = sky_sun_radiance(&sky), red = sky_sun_radiance(&low);
    double lux = (double)rgb_luminance(high) * SKY_SUN_ANGLE;
    printf("sun at 45 degrees: %.0f lx\n", lux);
    CHECK(lux > 70e3 && lux < 100e3);
    CHECK(red.r / red.b > 2.0f * high.r / high.b);
}

/* The map shows the sun where it stands, with all its light. */
static void test_map(void) {
    struct sky sky = {.sun = {0.6, 2.0}, .turbidity = 3.0, .north = 0.3};
    struct compass compass = compass_of(vec3_make(0.0f, 0.0f, 1.0f));
    struct image map;
    sky_map(&sky, &compass, DISTANT_WHOLE, &map);
    double sum = 0.0, direction[3] = {0, 0, 0};
    for (uint32_t i = 0; i < map.width * map.height; i++) {
        vec3 d = latlong_pixel(map.width, map.height, i % map.width, i / map.width);
        const float *p = map.pixel + 3 * (size_t)i;
        double light = (double)rgb_luminance(rgb_make(p[0], p[1], p[2]));
        if (light < 1e7) /* sky */
            continue;
        light *= latlong_pixel_angle(map.width, map.height, i / map.width);
        sum += light;
        direction[0] += light * (double)d.x;
        direction[1] += light * (double)d.y;
        direction[2] += light * (double)d.z;
    }
    double azimuth = sky.sun.azimuth + sky.north, level = cos(sky.sun.elevation);
    CHECK_NEAR(sum / ((double)rgb_luminance(sky_sun_radiance(&sky)) * SKY_SUN_ANGLE), 1.0, 0.03);
    CHECK_NEAR(direction[0] / sum, level * sin(azimuth), 2e-3); /* east is x, north is y */
    CHECK_NEAR(direction[1] / sum, level * cos(azimuth), 2e-3);
    CHECK_NEAR(direction[2] / sum, sin(sky.sun.elevation), 2e-3);
    image_release(&map);
}

/* Sky and sun add up to the whole, the ground that each of them lights included; the sky alone has no disc. */
static void test_parts(void) {
    struct sky sky = {.sun = {0.6, 2.0}, .turbidity = 3.0};
    struct compass compass = compass_of(vec3_make(0.0f, 1.0f, 0.0f));
    struct image whole, part[2];
    float brightest = 0.0f;
    sky_map(&sky, &compass, DISTANT_WHOLE, &whole);
    sky_map(&sky, &compass, DISTANT_SKY, &part[0]);
    sky_map(&sky, &compass, DISTANT_SUN, &part[1]);
    for (size_t i = 0; i < (size_t)whole.width * whole.height * 3; i++) {
        float sum = part[0].pixel[i] + part[1].pixel[i];
        CHECK_NEAR(sum, whole.pixel[i], 1e-4f * whole.pixel[i]);
        brightest = fmaxf(brightest, part[0].pixel[i]);
    }
    CHECK_THAT(brightest < 1e6f, "the sky alone is as bright as %g", (double)brightest);
    image_release(&whole);
    image_release(&part[0]);
    image_release(&part[1]);
}

int main(void) {
    test_parts();
    test_position();
    test_zenith();
    test_sun();
    test_map();
    return check_result();
}
