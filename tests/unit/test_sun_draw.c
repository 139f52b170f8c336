/* sun.h: a sun that is drawn into the map of distant light is read back by the renderer where it is and as strong as it
 * is: at the poles, near them, at the horizon, around the seam, in a small map and in one that is made finer for it;
 * what the map had before stays where it was. */
#include "common/mem.h"
#include "server/gather/sun.h"
#include "server/render/light.h"
#include "server/scene/latlong.h"
#include "tests/check.h"

#define WIDTH 64
#define HEIGHT (WIDTH / 2)

static void make_environment(struct environment *e) {
    static const char *const channels[] = {"count", "spread"};
    *e = (struct environment){0};
    image_init_rgb(&e->map, WIDTH, HEIGHT);
    image_init(&e->confidence, WIDTH, HEIGHT, 2, channels);
    e->is_bound = mem_calloc(WIDTH * HEIGHT, sizeof *e->is_bound);
}

/* What comes from all directions, and in the mean from where, as the renderer reads the map. */
static vec3 light_of(const struct environment *e, double *all) {
    const uint32_t fine = e->map.width > 128 ? 2 : 6, width = e->map.width, height = e->map.height;
    struct lights *lights = lights_new(&e->map);
    double sum[3] = {0.0};
    *all = 0.0;
    for (uint32_t row = 0; row < (height - 1) * fine; row++) {
        double band = cos(latlong_polar(height, (double)row / fine)) - cos(latlong_polar(height, (row + 1.0) / fine));
        for (uint32_t column = 0; column < width * fine; column++) {
            vec3 d = latlong_pixel(width, height, (column + 0.5) / fine, (row + 0.5) / fine);
            double light = band * 2.0 * PI / (width * fine) * (double)lights_environment(lights, d).g;
            sum[0] += light * (double)d.x, sum[1] += light * (double)d.y, sum[2] += light * (double)d.z;
            *all += light;
        }
    }
    lights_free(lights);
    return vec3_normalize((vec3){(float)(sum[0] / *all), (float)(sum[1] / *all), (float)(sum[2] / *all)});
}

static double degrees_between(vec3 a, vec3 b) {
    return 2.0 * asin(fmin(1.0, 0.5 * (double)vec3_length(vec3_sub(a, b)))) * 180.0 / PI;
}

static void check_sun(double azimuth_deg, double elevation_deg, double radius_deg, double most_deg) {
    struct environment e;
    make_environment(&e);
    struct sun sun = {.is_there = true,
                      .radius_rad = (float)(radius_deg * PI / 180.0),
                      .irradiance = {4.0f, 3.0f, 2.0f},
                      .direction = latlong_direction(azimuth_deg / 360.0, (90.0 - elevation_deg) / 180.0)};
    sun_draw(&sun, &e);
    double all;
    vec3 found = light_of(&e, &all);
    double off = degrees_between(found, sun.direction);
    CHECK_THAT(off < most_deg, "a sun at %g, %g of radius %g is drawn off by %.3f degrees", azimuth_deg, elevation_deg,
               radius_deg, off);
    CHECK_NEAR(all / 3.0, 1.0, 0.01);
    environment_release(&e);
}

/* A gradient that the map can hold exactly enough: made finer, it is where it was. */
static void check_refined(void) {
    struct environment e;
    make_environment(&e);
    for (size_t i = 0; i < WIDTH * HEIGHT; i++) {
        vec3 d = environment_direction(&e, i % WIDTH, i / WIDTH);
        for (size_t c = 0; c < 3; c++)
            e.map.pixel[3 * i + c] = 2.0f + d.x + 0.5f * d.y;
        e.confidence.pixel[2 * i] = d.y > 0.0f ? 3.0f : 0.0f;
    }
    struct sun sun = {.is_there = true, .direction = {0.0f, 0.0f, -1.0f}, .radius_rad = 0.03f};
    sun_draw(&sun, &e);
    CHECK(e.map.width == 4 * WIDTH && e.confidence.width == 4 * WIDTH);
    for (uint32_t y = 0; y < e.map.height; y++) {
        for (uint32_t x = 0; x < e.map.width; x++) {
            vec3 d = latlong_pixel(e.map.width, e.map.height, x, y);
            size_t at = (size_t)y * e.map.width + x;
            CHECK_NEAR(e.map.pixel[3 * at], 2.0f + d.x + 0.5f * d.y, 0.01f);
            float count = e.confidence.pixel[2 * at];
            CHECK(count == 0.0f || count == 3.0f);
            CHECK(fabsf(d.y) < 0.06f || (count > 0.0f) == (d.y > 0.0f));
        }
    }
    environment_release(&e);
}

int main(void) {
    const double azimuth[] = {0.0, 71.0, 181.3, 359.5}, elevation[] = {90.0, 86.0, 70.0, 35.0, 0.0, -50.0, -88.0};
    for (size_t a = 0; a < 4; a++)
        for (size_t i = 0; i < 7; i++)
            check_sun(azimuth[a], elevation[i], 6.0, 0.45); /* pixels of 5.8 degrees */
    check_sun(33.0, 88.0, 1.2, 0.1);                        /* of .7 */
    check_sun(200.0, 57.0, 1.2, 0.1);
    check_refined();
    return check_result();
}
