/* sun_seen.h: a sun that was drawn into a map of distant light is taken out of it again, as strong, as wide and where
 * it was, also blurred as photographs blur it, and the sky about it is what it was; at a pole, around the seam. Where
 * photographs saturate in it, it is as strong as that at least. What is cut by unseen directions, wide or weak stays,
 * and so do what saturates below the horizon and what is in a map of near things. */
#include "common/mem.h"
#include "server/light/sun/sun_seen.h"
#include "server/scene/latlong.h"
#include "tests/check.h"

#define WIDTH 512
#define HEIGHT (WIDTH / 2)

/* A sky that gets brighter to +x, all of it measured. */
static float sky_at(const struct environment *e, size_t pixel) {
    return 1.0f + 0.3f * environment_direction(e, pixel % WIDTH, pixel / WIDTH).x;
}

static void make_sky(struct environment *e) {
    environment_make_empty(e, WIDTH);
    for (size_t i = 0; i < WIDTH * HEIGHT; i++) {
        e->confidence.pixel[2 * i] = 1.0f;
        for (size_t c = 0; c < 3; c++)
            e->map.pixel[3 * i + c] = sky_at(e, i);
    }
}

/* Means of three neighbours in each row, by solid angle the same light. */
static void blur(struct environment *e) {
    float *before = mem_array(3 * WIDTH * HEIGHT, sizeof *before);
    memcpy(before, e->map.pixel, 3 * WIDTH * HEIGHT * sizeof *before);
    for (size_t i = 0; i < 3 * WIDTH * HEIGHT; i++) {
        size_t row = i / (3 * WIDTH), at = i % (3 * WIDTH);
        const float *of_row = before + row * 3 * WIDTH;
        e->map.pixel[i] =
            (of_row[(at + 3) % (3 * WIDTH)] + of_row[at] + of_row[(at + 3 * WIDTH - 3) % (3 * WIDTH)]) / 3;
    }
    mem_free(before);
}

static struct sun sun_at(double azimuth_deg, double elevation_deg, double radius_deg, float strength) {
    return (struct sun){.is_there = true,
                        .radius_rad = (float)(radius_deg * PI / 180.0),
                        .irradiance = rgb_scale(rgb_make(12.0f, 9.0f, 5.0f), strength),
                        .direction = latlong_direction(azimuth_deg / 360.0, (90.0 - elevation_deg) / 180.0)};
}

static void check_taken(struct sun drawn, bool blurs) {
    struct environment e;
    struct sun taken = {0};
    make_sky(&e);
    sun_draw(&drawn, &e);
    if (blurs)
        blur(&e);
    CHECK(sun_seen_take(&e, &taken) && taken.is_there && taken.is_measured);
    float radius = fmaxf(drawn.radius_rad, (float)(PI / HEIGHT));
    CHECK_THAT(vec3_dot(taken.direction, drawn.direction) > cosf(0.004f), "%g %g %g", (double)taken.direction.x,
               (double)taken.direction.y, (double)taken.direction.z);
    CHECK_NEAR(taken.radius_rad, radius, 0.3f * radius);
    CHECK_NEAR(taken.irradiance.r, drawn.irradiance.r, 0.02f * drawn.irradiance.r);
    CHECK_NEAR(taken.irradiance.b, drawn.irradiance.b, 0.02f * drawn.irradiance.b);
    for (size_t i = 0; i < WIDTH * HEIGHT; i++)
        CHECK_NEAR(e.map.pixel[3 * i], sky_at(&e, i), 0.05f);
    environment_release(&e);
}

/* What photographs show of the sun: no more than SHOWN, and it is a bound. */
#define SHOWN 40.0f

static void saturate(struct environment *e) {
    for (size_t i = 0; i < WIDTH * HEIGHT; i++) {
        e->is_bound[i] = rgb_mean(environment_pixel_radiance(e, i)) > SHOWN;
        for (size_t c = 0; c < 3; c++)
            e->map.pixel[3 * i + c] = fminf(e->map.pixel[3 * i + c], SHOWN);
    }
    environment_update_figures(e);
}

static void check_clipped(struct sun drawn) {
    struct environment e;
    struct sun taken = {0};
    make_sky(&e);
    sun_draw(&drawn, &e);
    blur(&e);
    saturate(&e);
    CHECK(e.saturated_share > 0.0 && sun_seen_take(&e, &taken));
    CHECK(taken.is_there && taken.is_clipped && !taken.is_measured && e.saturated_share == 0.0);
    CHECK(vec3_dot(taken.direction, drawn.direction) > cosf(0.004f));
    CHECK_NEAR(taken.radius_rad, SUN_RADIUS_RAD, 1e-6f);
    CHECK(taken.least.r > 0.0f && taken.least.r < drawn.irradiance.r);
    for (size_t i = 0; i < WIDTH * HEIGHT; i++) {
        CHECK(!e.is_bound[i]);
        CHECK_NEAR(e.map.pixel[3 * i], sky_at(&e, i), 0.05f);
    }
    environment_release(&e);
}

/* What is done to the pixel in the sun's middle, and to a map. */
enum harm { UNSEEN, SATURATED, NEAR, NOTHING };

static void check_left(struct sun drawn, enum harm harm) {
    struct environment e;
    struct sun taken = {0};
    make_sky(&e);
    sun_draw(&drawn, &e);
    size_t middle = environment_cell(&e, drawn.direction);
    if (harm == UNSEEN)
        e.confidence.pixel[2 * (middle + 1)] = 0.0f;
    if (harm == SATURATED)
        saturate(&e);
    for (size_t i = 0; i < WIDTH * HEIGHT && harm == NEAR; i++) {
        e.confidence.pixel[2 * i] = 2.0f;
        e.confidence.pixel[2 * i + 1] = i % 2 ? 0.3f : 0.5f;
    }
    environment_update_figures(&e);
    float before = e.map.pixel[3 * middle];
    CHECK(!sun_seen_take(&e, &taken) && !taken.is_there);
    CHECK(e.map.pixel[3 * middle] == before);
    environment_release(&e);
}

int main(void) {
    struct environment none = {0};
    struct sun taken = {0};
    CHECK(!sun_seen_take(&none, &taken));
    check_taken(sun_at(40.0, 35.0, 1.5, 1.0f), false);
    check_taken(sun_at(40.0, 35.0, 1.5, 1.0f), true);
    check_taken(sun_at(359.8, 10.0, 1.0, 1.0f), true);
    check_taken(sun_at(10.0, 89.0, 2.0, 1.0f), false);
    check_left(sun_at(40.0, 35.0, 1.5, 1.0f), UNSEEN);
    check_clipped(sun_at(40.0, 35.0, 1.5, 1.0f));
    check_left(sun_at(40.0, -35.0, 1.5, 1.0f), SATURATED);
    check_left(sun_at(40.0, 35.0, 1.5, 1.0f), NEAR);
    check_left(sun_at(40.0, 35.0, 6.0, 20.0f), NOTHING);
    check_left(sun_at(40.0, 35.0, 1.0, 0.01f), NOTHING); /* a hundredth of the sky's light */
    return check_result();
}
