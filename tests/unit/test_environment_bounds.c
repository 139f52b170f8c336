/* environment_bounds.h: directions that only long exposures show are told by those that short ones measured: as unseen
 * where these continue beyond the bound, else as bright as what exceeds it. One exposure tells nothing, nor does the
 * ground tell of the sky; a sun stays a bound. */
#include "common/mem.h"
#include "server/capture/distant/environment_bounds.h"
#include "tests/check.h"

#define WIDTH 128
#define HEIGHT (WIDTH / 2)
#define CELLS (WIDTH * HEIGHT)

#define SKY 4.0f
#define GROUND 0.7f
#define SHORT 14.0f /* up to which the short exposures measure, */
#define LONG 1.4f   /* and the long ones */

struct sky {
    struct environment e;
    float radiance[CELLS];
    uint8_t bound_channels[CELLS];
    struct environment_ceiling ceiling;
};

static size_t pixel_at(size_t column, size_t row) { return row * WIDTH + column; }

/* Seen all around, each pixel up to the ceiling; what is beyond it in a channel is a bound. */
static void look(struct sky *s, size_t pixel, rgb radiance, float ceiling) {
    s->radiance[pixel] = ceiling;
    s->bound_channels[pixel] = 0;
    s->e.confidence.pixel[2 * pixel] = 1.0f;
    for (size_t c = 0; c < 3; c++) {
        float value = (&radiance.r)[c];
        s->e.map.pixel[3 * pixel + c] = fminf(value, ceiling);
        s->bound_channels[pixel] |= (uint8_t)((value > ceiling) << c);
    }
    s->e.is_bound[pixel] = s->bound_channels[pixel] != 0;
}

/* Sky over ground, all of it under photographs that measure up to `ceiling`. */
static void make(struct sky *s, float ceiling) {
    environment_make_empty(&s->e, WIDTH);
    s->ceiling = (struct environment_ceiling){s->radiance, s->bound_channels};
    for (size_t i = 0; i < CELLS; i++)
        look(s, i, rgb_gray(i < CELLS / 2 ? SKY : GROUND), ceiling);
}

static bool is_unseen(const struct sky *s, size_t pixel) {
    return !environment_pixel_is_seen(&s->e, pixel) && !s->e.is_bound[pixel];
}

/* A patch that the long exposures alone show; a sun; a roof, in which the long exposures alone see a piece of sky that
 * is brighter than the roof, of a colour of which two channels are measured. */
static void test_told(void) {
    static struct sky s;
    const size_t patch = pixel_at(30, 12), sun = pixel_at(70, 10), gap = pixel_at(100, 22);
    make(&s, SHORT);
    for (size_t y = 20; y < 26; y++)
        for (size_t x = 95; x < 107; x++)
            look(&s, pixel_at(x, y), rgb_gray(0.5f), SHORT);
    for (size_t y = 10; y < 15; y++)
        for (size_t x = 25; x < 35; x++)
            look(&s, pixel_at(x, y), rgb_gray(SKY), LONG);
    look(&s, gap, rgb_make(1.0f, 1.2f, SKY), LONG);
    look(&s, sun, rgb_gray(1e4f), SHORT);
    environment_tell_bounds(&s.e, &s.ceiling);
    CHECK(is_unseen(&s, patch) && is_unseen(&s, pixel_at(25, 14)));
    CHECK(s.e.is_bound[sun] && s.e.map.pixel[3 * sun] == SHORT && environment_pixel_is_seen(&s.e, sun));
    CHECK(!s.e.is_bound[gap] && environment_pixel_is_seen(&s.e, gap));
    CHECK_NEAR(s.e.map.pixel[3 * gap], 1.0f, 1e-6f); /* measured */
    CHECK_NEAR(s.e.map.pixel[3 * gap + 2], SKY, 1e-3f);
    CHECK(!is_unseen(&s, pixel_at(60, 5)) && !is_unseen(&s, pixel_at(60, 60)));
    environment_release(&s.e);
}

static size_t bound_count(const struct sky *s) {
    size_t count = 0;
    for (size_t i = 0; i < CELLS; i++)
        count += s->e.is_bound[i] && environment_pixel_is_seen(&s->e, i);
    return count;
}

/* Photographs of one exposure, whose vignettes differ by a quarter, over bright ground. */
static void test_one_exposure(void) {
    static struct sky s;
    make(&s, LONG);
    for (size_t i = 0; i < CELLS; i += 3)
        look(&s, i, rgb_gray(i < CELLS / 2 ? SKY : 1.2f * LONG), 1.25f * LONG);
    for (size_t i = CELLS / 2; i < CELLS; i += 6)
        look(&s, i, rgb_gray(1.2f * LONG), LONG);
    size_t before = bound_count(&s);
    environment_tell_bounds(&s.e, &s.ceiling);
    CHECK(before >= CELLS / 2 && bound_count(&s) == before);
    environment_release(&s.e);
}

/* Short exposures see the ground only, with lit walls that are half as bright as the sky, and a dark roof. */
static void test_ground(void) {
    static struct sky s;
    make(&s, LONG);
    for (size_t i = CELLS / 2; i < CELLS; i++)
        look(&s, i, rgb_gray(i % WIDTH < WIDTH / 2 ? 0.5f * SKY : GROUND), SHORT);
    for (size_t i = 0; i < 20 * WIDTH; i += WIDTH)
        look(&s, i, rgb_gray(0.5f), SHORT);
    environment_tell_bounds(&s.e, &s.ceiling);
    CHECK_THAT(bound_count(&s) == CELLS / 2 - 20, "%zu", bound_count(&s));
    environment_release(&s.e);
}

int main(void) {
    test_told();
    test_one_exposure();
    test_ground();
    return check_result();
}
