/* fill.h: the angle to what is known, held against that to each known pixel in turn: at the seam, beside the poles,
 * far away; and behind one's back a sky above and ground below, as a window shows them. (Next to what is known:
 * render/test_environment.) */
#include "common/mem.h"
#include "common/vec.h"
#include "server/capture/distant/fill.h"
#include "server/scene/latlong.h"
#include "tests/check.h"

#define WIDTH 128
#define HEIGHT 64
#define KNOWN 4

static vec3 direction_of(size_t at) { return latlong_pixel(WIDTH, HEIGHT, (double)(at % WIDTH), (double)(at / WIDTH)); }

static double angle_between(size_t a, size_t b) {
    vec3 d = vec3_sub(direction_of(a), direction_of(b));
    return 2.0 * asin(fmin(0.5 * (double)vec3_length(d), 1.0));
}

static void check_angles(void) {
    static const size_t known[KNOWN] = {5 * WIDTH + 100, 20 * WIDTH, 40 * WIDTH + 70, 62 * WIDTH + 3};
    bool *is_known = mem_calloc(WIDTH * HEIGHT, sizeof *is_known);
    float *angle = mem_array(WIDTH * HEIGHT, sizeof *angle);
    double most = 0.0, least = 10.0;
    fill_angles(WIDTH, HEIGHT, is_known, angle);
    CHECK(isinf(angle[0]) && isinf(angle[WIDTH * HEIGHT - 1]));
    for (size_t k = 0; k < KNOWN; k++)
        is_known[known[k]] = true;
    fill_angles(WIDTH, HEIGHT, is_known, angle);
    for (size_t i = 0; i < WIDTH * HEIGHT; i++) {
        double nearest = 10.0;
        for (size_t k = 0; k < KNOWN; k++)
            nearest = fmin(nearest, angle_between(i, known[k]));
        if (nearest == 0.0)
            CHECK(angle[i] == 0.0f);
        else {
            most = fmax(most, (double)angle[i] / nearest);
            least = fmin(least, (double)angle[i] / nearest);
        }
    }
    printf("angles: %.3f to %.3f times the true ones\n", least, most);
    CHECK_THAT(least > 0.98 && most < 1.05, "%g to %g times the true ones", least, most);
    mem_free(is_known);
    mem_free(angle);
}

/* --- the horizon ---------------------------------------------------------------------------------- */

static rgb sky_or_ground(size_t row) { return row < HEIGHT / 2 ? (rgb){4.0f, 4.8f, 6.0f} : (rgb){1.2f, 1.1f, 0.8f}; }

/* The farthest from what is there, as a part of it, of the rows that a window shows (10 to 30 degrees high and deep)
 * and of those beyond. */
static void check_horizon(void) {
    bool *is_known = mem_calloc(WIDTH * HEIGHT, sizeof *is_known);
    struct image map;
    float beside = 0.0f, beyond = 0.0f;
    image_init_rgb(&map, WIDTH, HEIGHT);
    for (size_t i = 0; i < WIDTH * HEIGHT; i++) {
        size_t x = i % WIDTH, y = i / WIDTH;
        is_known[i] = x < WIDTH / 8 && y >= HEIGHT / 2 - 10 && y < HEIGHT / 2 + 10;
        rgb color = sky_or_ground(y);
        for (size_t c = 0; c < 3; c++)
            map.pixel[3 * i + c] = is_known[i] ? (&color.r)[c] : 0.0f;
    }
    fill_sphere(&map, is_known);
    for (size_t i = 0; i < WIDTH * HEIGHT; i++) {
        size_t y = i / WIDTH;
        rgb color = sky_or_ground(y);
        float *worst = y >= HEIGHT / 2 - 10 && y < HEIGHT / 2 + 10 ? &beside : &beyond;
        for (size_t c = 0; c < 3; c++)
            *worst = fmaxf(*worst, fabsf(map.pixel[3 * i + c] / (&color.r)[c] - 1.0f));
    }
    printf("a sky and its ground: %.2f off in rows of which a part is known, %.2f beyond\n", (double)beside,
           (double)beyond);
    CHECK_THAT(beside < 0.05f && beyond < 0.1f, "%g, %g", (double)beside, (double)beyond);
    image_release(&map);
    mem_free(is_known);
}

/* A sky twice as bright on one side as on the other, of which photographs show 20 rows of the bright side, and of the
 * dark side the 12 rows above them, too: above what is known of the bright side it is as bright as there. */
static void check_sides(void) {
    bool *is_known = mem_calloc(WIDTH * HEIGHT, sizeof *is_known);
    struct image map;
    float worst = 0.0f;
    image_init_rgb(&map, WIDTH, HEIGHT);
    for (size_t i = 0; i < WIDTH * HEIGHT; i++) {
        size_t x = i % WIDTH, y = i / WIDTH;
        bool is_dark_side = x >= WIDTH / 4;
        rgb color = rgb_scale(sky_or_ground(y), is_dark_side ? 0.5f : 1.0f);
        is_known[i] = (x < WIDTH / 8 && y >= HEIGHT / 2 - 10 && y < HEIGHT / 2 + 10) ||
                      (x >= WIDTH / 4 && x < WIDTH / 4 + 6 && y >= HEIGHT / 2 - 22 && y < HEIGHT / 2 + 10);
        for (size_t c = 0; c < 3; c++)
            map.pixel[3 * i + c] = is_known[i] ? (&color.r)[c] : 0.0f;
    }
    fill_sphere(&map, is_known);
    for (size_t y = HEIGHT / 2 - 20; y < HEIGHT / 2 - 10; y++) {
        for (size_t x = WIDTH / 32; x < WIDTH / 8 - 2; x++)
            worst = fmaxf(worst, fabsf(map.pixel[3 * (y * WIDTH + x)] / sky_or_ground(y).r - 1.0f));
    }
    printf("above what is known of the brighter side: %.2f off\n", (double)worst);
    CHECK_THAT(worst < 0.25f, "%g", (double)worst);
    image_release(&map);
    mem_free(is_known);
}

/* What is seen through the gaps of a scan: two pixels a column, the lower one half as bright again, each pair two rows
 * below and a column beside the last. Ratios of rows come to 1.5^40; nothing is brighter than 1.5. */
static void check_gaps(void) {
    bool *is_known = mem_calloc(WIDTH * HEIGHT, sizeof *is_known);
    struct image map;
    float brightest = 0.0f;
    image_init_rgb(&map, WIDTH, HEIGHT);
    for (size_t y = 10; y < 51; y++) {
        for (size_t k = 0; k < 2; k++) {
            size_t i = (y + k) * WIDTH + 2 * y;
            is_known[i] = true;
            for (size_t c = 0; c < 3; c++)
                map.pixel[3 * i + c] = k ? 1.5f : 1.0f;
        }
    }
    fill_sphere(&map, is_known);
    for (size_t i = 0; i < 3 * WIDTH * HEIGHT; i++)
        brightest = fmaxf(brightest, map.pixel[i]);
    printf("around gaps that show 1 to 1.5: up to %.2f\n", (double)brightest);
    CHECK_THAT(brightest < 6.1f, "%g", (double)brightest);
    image_release(&map);
    mem_free(is_known);
}

int main(void) {
    check_angles();
    check_horizon();
    check_sides();
    check_gaps();
    return check_result();
}
