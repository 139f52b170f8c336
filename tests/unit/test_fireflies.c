/* fireflies.h: single pixels that are far too bright are told from noise, from lines, edges and lamps of two pixels,
 * also in corners; no look-up that reads one is used. */
#include "server/capture/fireflies.h"

#include "common/image.h"
#include "common/mem.h"
#include "tests/check.h"
#include "tests/unit/normal.h"

#define SIDE 96
#define PIXELS (SIDE * SIDE)
#define PHOTOGRAPHS 3 /* the second is held out, the third has twelve times the noise */
#define SHARE 0.08f   /* noise of what is shown */
#define NOISY 12.0f
#define HOT (28 * SIDE + 44) /* a pixel of a dark photograph */

static struct photograph photograph[PHOTOGRAPHS];
static struct scene scene = {.photograph = photograph, .photograph_count = PHOTOGRAPHS};
static uint32_t train[2] = {0, 2};
static struct views views = {.scene = &scene, .train_count = 2, .train = train};
static float one[PIXELS], more[PIXELS], *scale[2] = {one, more};
static struct noise noise = {.train_count = 2, .scale = scale};

/* Where a pixel is made brighter, how often as bright, and whether that is by chance: a line and a lamp of two pixels
 * are not. */
static const struct {
    uint32_t x, y;
    float times;
    bool is_spark;
} bright[] = {{0, 0, 8.0f, true},    {95, 95, 3.5f, true},  {95, 7, 9.0f, true},    {40, 40, 100.0f, true},
              {20, 20, 4.0f, true},  {23, 20, 4.0f, true},  {60, 60, 30.0f, false}, {61, 61, 30.0f, false},
              {70, 10, 6.0f, false}, {71, 10, 6.0f, false}, {72, 10, 6.0f, false},  {50, 80, 1.4f, false}};
#define BRIGHT (sizeof bright / sizeof *bright)

static void take(void) {
    for (uint32_t t = 0; t < PHOTOGRAPHS; t++) {
        photograph[t] = (struct photograph){.camera = {.width = SIDE, .height = SIDE},
                                            .exposure = 1.0f,
                                            .gain = {1.0f, 1.0f, 1.0f},
                                            .is_hdr = true,
                                            .is_test = t == 1,
                                            .clip = INFINITY};
        photograph[t].pixel = mem_array(PIXELS, sizeof *photograph[t].pixel);
        for (uint32_t i = 0; i < PIXELS; i++)
            for (uint32_t c = 0; c < 3; c++)
                photograph[t].pixel[i][c] =
                    image_half_from_float((i % SIDE < 48 ? 0.1f : 0.4f) * (1.0f + SHARE * normal(3 * t + c, i)));
        for (size_t k = 0; k < BRIGHT; k++)
            for (int c = 0; c < 3; c++) {
                uint16_t *value = &photograph[t].pixel[bright[k].y * SIDE + bright[k].x][c];
                *value = image_half_from_float(bright[k].times * image_float_from_half(*value));
            }
    }
    for (int k = 0; k < NOISE_OCTAVES; k++)
        noise.share[k] = SHARE;
    for (size_t i = 0; i < PIXELS; i++) {
        one[i] = 1.0f;
        more[i] = NOISY;
    }
}

/* Those that are marked; checks what each of `bright` is. */
static size_t count_marked(const struct photograph *photo, float times_least) {
    size_t marked = 0;
    for (size_t i = 0; i < PIXELS; i++)
        marked += photo->firefly[i];
    for (size_t k = 0; k < BRIGHT; k++)
        CHECK_THAT(photo->firefly[bright[k].y * SIDE + bright[k].x] ==
                       (bright[k].is_spark && bright[k].times >= times_least),
                   "pixel %u %u, %.1f times as bright", bright[k].x, bright[k].y, (double)bright[k].times);
    return marked;
}

/* Pixels that a bilinear look-up does not read do not count; a cubic one reads more. */
static void test_lookups(const struct photograph *photo) {
    rgb shown;
    CHECK(photograph_has_firefly(photo, 40.5f, 40.5f) && photograph_has_firefly(photo, 41.4f, 40.5f) &&
          photograph_has_firefly(photo, 40.6f, 39.6f) && photograph_has_firefly(photo, 0.1f, 0.1f));
    CHECK(!photograph_has_firefly(photo, 41.5f, 40.5f) && !photograph_has_firefly(photo, 39.5f, 41.0f) &&
          !photograph_has_firefly(photo, 30.2f, 70.8f) && !photograph_has_firefly(photo, 60.5f, 60.5f));
    CHECK(!photograph_sample_cubic(photo, 39.0f, 40.5f, &shown));
    CHECK(photograph_sample_cubic(photo, 38.0f, 40.5f, &shown));
    CHECK_THAT(!photograph_has_firefly(&photograph[1], 40.5f, 40.5f), "nobody asked of this photograph");
}

/* Of 8 bits what should be black is not for its noise; what is brighter by far more than that still is a firefly. */
static void test_black(struct parallel *pool) {
    static struct photograph dark = {
        .camera = {.width = SIDE, .height = SIDE}, .exposure = 1.0f, .gain = {1.0f, 1.0f, 1.0f}, .clip = 1.0f};
    static struct scene night = {.photograph = &dark, .photograph_count = 1};
    static struct views sees = {.scene = &night, .train_count = 1, .train = train};
    struct noise faint = noise;
    size_t marked = 0;
    dark.pixel = mem_calloc(PIXELS, sizeof *dark.pixel);
    for (size_t i = 0; i < PIXELS / 16; i++) {
        size_t pixel = 4 * (i % (SIDE / 4)) + 4 * SIDE * (i / (SIDE / 4));
        for (int c = 0; c < 3; c++)
            dark.pixel[pixel][c] = image_half_from_float(pixel == HOT ? 0.05f : 0.002f);
    }
    faint.black = 0.002f;
    fireflies_mark(&night, &sees, &faint, pool);
    for (size_t i = 0; i < PIXELS; i++)
        marked += dark.firefly[i];
    CHECK_THAT(marked == 1 && dark.firefly[HOT], "%zu marked", marked);
    photograph_release(&dark);
}

int main(void) {
    take();
    struct parallel *pool = parallel_new(2);
    fireflies_mark(&scene, &views, &noise, pool);
    CHECK(photograph[0].firefly && !photograph[1].firefly && photograph[2].firefly);
    CHECK(count_marked(&photograph[0], 0.0f) == 6);
    test_lookups(&photograph[0]);
    test_black(pool);
    CHECK_THAT(count_marked(&photograph[2], 4.5f) == 3, "noise explains what is a few times as bright");
    bool *first = mem_array(PIXELS, sizeof *first);
    memcpy(first, photograph[0].firefly, PIXELS * sizeof *first);
    struct parallel *alone = parallel_new(1);
    fireflies_mark(&scene, &views, &noise, alone);
    CHECK(memcmp(first, photograph[0].firefly, PIXELS * sizeof *first) == 0);
    mem_free(first);
    parallel_free(alone);
    parallel_free(pool);
    for (int t = 0; t < PHOTOGRAPHS; t++)
        photograph_release(&photograph[t]);
    return check_result();
}
