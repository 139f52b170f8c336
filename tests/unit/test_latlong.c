/* latlong.h: places and directions lead back to each other; solid angles come to 4 pi and weigh a map as the renderer's
 * interpolation does; the layout is that of Mitsuba 3, by the colours that it reads in nine directions. */
#include "common/image.h"
#include "common/rng.h"
#include "server/render/light.h"
#include "server/scene/latlong.h"
#include "tests/check.h"

#define DIRECTIONS 20000

/* Evenly over the sphere. */
static vec3 direction(uint32_t i) {
    double up = 1.0 - 2.0 * ((double)i + 0.5) / DIRECTIONS, turn = 2.399963229728653 * (double)i,
           r = sqrt(1.0 - up * up);
    return (vec3){(float)(r * sin(turn)), (float)up, (float)(-r * cos(turn))};
}

static void check_round_trip(uint32_t width, uint32_t height) {
    for (uint32_t i = 0; i < DIRECTIONS; i++) {
        vec3 d = direction(i), back;
        float x, y;
        latlong_place(width, height, d, &x, &y);
        CHECK(x >= 0.0f && x < (float)width && y >= 0.0f && y < (float)(height - 1));
        back = latlong_pixel(width, height, (double)x, (double)y);
        CHECK_THAT(vec3_length(vec3_sub(d, back)) < 2e-3f, "%g %g %g", (double)d.x, (double)d.y, (double)d.z);
        struct latlong at = latlong_of(d);
        CHECK(vec3_length(vec3_sub(d, latlong_direction(at.around, at.down))) < 5e-4f);
    }
    for (uint32_t y = 1; y + 1 < height; y++)
        for (uint32_t x = 0; x < width; x++)
            CHECK(latlong_nearest(width, height, latlong_pixel(width, height, x, y)) == (size_t)y * width + x);
    CHECK(latlong_pixel(width, height, 3.0, 0.0).y == 1.0f && latlong_pixel(width, height, 3.0, height - 1).y == -1.0f);
    CHECK(latlong_nearest(width, height, (vec3){0.0f, 1.0f, 0.0f}) < width);
    CHECK(latlong_nearest(width, height, (vec3){0.0f, -1.0f, 0.0f}) >= (size_t)(height - 1) * width);
}

/* Over the sphere's two coordinates, so that no direction is missed. */
static double integral_of(const struct lights *lights, uint32_t width, uint32_t height) {
    const uint32_t fine = 16;
    double sum = 0.0;
    for (uint32_t row = 0; row < (height - 1) * fine; row++) {
        double y = (row + 0.5) / fine,
               band = cos(latlong_polar(height, (double)row / fine)) - cos(latlong_polar(height, (row + 1.0) / fine));
        for (uint32_t column = 0; column < width * fine; column++) {
            vec3 d = latlong_pixel(width, height, (column + 0.5) / fine, y);
            sum += band * 2.0 * PI / (width * fine) * (double)lights_environment(lights, d).r;
        }
    }
    return sum;
}

/* What pixels weigh is what the renderer makes of them: of a map of random numbers, and of each pole alone. */
static void check_angles(uint32_t width, uint32_t height) {
    double whole = 0.0, cells = 0.0;
    for (uint32_t y = 0; y < height; y++)
        whole += width * latlong_pixel_angle(width, height, y);
    for (uint32_t y = 0; y + 1 < height; y++)
        cells += width * latlong_cell_angle(width, height, y);
    CHECK_NEAR(whole, 4.0 * PI, 1e-9);
    CHECK_NEAR(cells, 4.0 * PI, 1e-9);
    for (int what = 0; what < 3; what++) {
        struct image map;
        double weighed = 0.0;
        image_init_rgb(&map, width, height);
        for (uint32_t i = 0; i < width * height; i++) {
            bool is_there = what == 0 || (what == 1 && i < width) || (what == 2 && i >= width * (height - 1));
            float value = is_there ? 1.0f + rng_to_float((uint32_t)rng_key(1, i, 0)) : 0.0f;
            map.pixel[3 * i] = map.pixel[3 * i + 1] = map.pixel[3 * i + 2] = value;
            weighed += latlong_pixel_angle(width, height, i / width) * (double)value;
        }
        struct lights *lights = lights_new(&map);
        CHECK_NEAR(integral_of(lights, width, height) / weighed, 1.0, 2e-3);
        lights_free(lights);
        image_release(&map);
    }
}

/* environment.csv: a direction, its column over the width and its row over (height - 1), the colour there. */
static void check_mitsuba(void) {
    struct image map;
    struct image_info info;
    struct error err;
    FILE *file = fopen(check_data("conformance/environment.csv"), "r");
    CHECK(image_read(check_data("hdri/lythwood_room_1k.hdr"), &map, &info, &err) == STATUS_OK);
    struct lights *lights = lights_new(&map);
    char line[512];
    int count = 0;
    for (bool head = true; file && fgets(line, sizeof line, file); head = false) {
        double v[8];
        if (head ||
            sscanf(line, "%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf", v, v + 1, v + 2, v + 3, v + 4, v + 5, v + 6, v + 7) != 8)
            continue;
        vec3 d = vec3_normalize((vec3){(float)v[0], (float)v[1], (float)v[2]});
        struct latlong at = latlong_of(d);
        rgb found = lights_environment(lights, d);
        bool is_pole = fabs(v[1]) == 1.0; /* where every azimuth is right */
        CHECK(is_pole || fabs(at.around - v[3]) < 1e-5);
        CHECK_NEAR(at.down, v[4], 1e-5);
        for (int c = 0; c < 3 && !is_pole; c++)
            CHECK_NEAR((double)(&found.r)[c] / v[5 + c], 1.0, 2e-3);
        count++;
    }
    CHECK_THAT(count == 9, "%d directions", count);
    if (file)
        fclose(file);
    lights_free(lights);
    image_release(&map);
}

int main(void) {
    check_round_trip(64, 32);
    check_round_trip(100, 51);
    check_angles(16, 8);
    check_angles(64, 32);
    check_mitsuba();
    return check_result();
}
