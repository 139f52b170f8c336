/* clip.h: which pixels of 8 bits saturate is told by those around them: what photographs show of a noisy surface near
 * the clip is then right in the mean or told to be a bound. */
#include "server/capture/clip.h"

#include "common/image.h"
#include "common/mem.h"
#include "tests/check.h"
#include "tests/unit/normal.h"

#define SIDE 96
#define PIXELS (SIDE * SIDE)
#define PHOTOGRAPHS 3 /* the second is HDR, the third is held out */
#define STRIPE 24     /* rows */
#define SHARE 0.2f    /* noise of what is shown */

static struct photograph photograph[PHOTOGRAPHS];
static struct scene scene = {.photograph = photograph, .photograph_count = PHOTOGRAPHS};
static uint32_t train[2] = {0, 1};
static uint8_t edge_pixels[PIXELS], owner_pixels[PIXELS], *edge[2] = {edge_pixels, edge_pixels},
                                                          *owner[2] = {owner_pixels, owner_pixels};
static struct views views = {.scene = &scene, .train_count = 2, .train = train, .edge = edge, .owner = owner};
static float one[PIXELS], *scale[2] = {one, one};
static struct noise noise = {.train_count = 2, .scale = scale};

/* Stripes of surfaces: below the clip of 1, about it, at it, and beyond it, with black tiles of the same surface. */
static float shown(uint32_t x, uint32_t y) {
    static const float stripe[SIDE / STRIPE] = {0.5f, 0.8f, 1.0f, 1.3f};
    bool is_tile = y / STRIPE == 3 && x / 4 % 4 == 0;
    return is_tile ? 0.05f : stripe[y / STRIPE];
}

static void take(void) {
    for (uint32_t t = 0; t < PHOTOGRAPHS; t++) {
        photograph[t] = (struct photograph){.camera = {.width = SIDE, .height = SIDE},
                                            .exposure = 1.0f,
                                            .gain = {1.0f, 1.0f, 1.0f},
                                            .is_hdr = t == 1,
                                            .is_test = t == 2,
                                            .clip = t == 1 ? INFINITY : 1.0f};
        photograph[t].pixel = mem_array(PIXELS, sizeof *photograph[t].pixel);
        for (uint32_t i = 0; i < PIXELS; i++) {
            float v = shown(i % SIDE, i / SIDE);
            for (uint32_t c = 0; c < 3; c++)
                photograph[t].pixel[i][c] =
                    image_half_from_float(fminf(v * (1.0f + SHARE * normal(3 * t + c, i)), photograph[t].clip));
            owner_pixels[i] = (uint8_t)(i / SIDE / STRIPE);
        }
    }
    for (int k = 0; k < NOISE_OCTAVES; k++)
        noise.share[k] = SHARE;
    for (size_t i = 0; i < PIXELS; i++)
        one[i] = 1.0f;
}

/* Of a stripe, or of its tiles: the share of pixels that are said to saturate in red, and the mean of the others. */
struct clip_case {
    double white, mean;
};

static struct clip_case read_stripe(uint32_t stripe, bool of_tiles) {
    double white = 0.0, sum = 0.0, count = 0.0;
    for (uint32_t i = stripe * STRIPE * SIDE; i < (stripe + 1) * STRIPE * SIDE; i++) {
        struct photograph_sample s;
        if ((shown(i % SIDE, i / SIDE) < 0.1f) != of_tiles)
            continue;
        CHECK(photograph_sample(&photograph[0], (float)(i % SIDE) + 0.5f, (float)(i / SIDE) + 0.5f, &s));
        count += 1.0;
        white += s.saturated[0];
        sum += s.saturated[0] ? 0.0 : (double)s.radiance.r;
        CHECK(!s.saturated[0] || s.radiance.r >= 1.0f);
    }
    return (struct clip_case){white / count, sum / fmax(count - white, 1.0)};
}

int main(void) {
    take();
    struct parallel *pool = parallel_new(2);
    clip_mark(&scene, &views, &noise, pool);
    CHECK(photograph[0].saturated && !photograph[1].saturated && !photograph[2].saturated);
    struct clip_case below = read_stripe(0, false), about = read_stripe(1, false), at = read_stripe(2, false),
                     beyond = read_stripe(3, false), tiles = read_stripe(3, true);
    CHECK(below.white == 0.0);
    CHECK_NEAR(below.mean, 0.5, 0.01);
    CHECK_THAT(at.white > 0.95 && beyond.white > 0.98, "%g %g", at.white, beyond.white);
    CHECK(tiles.white == 0.0);
    CHECK_NEAR(tiles.mean, 0.05, 0.003);
    CHECK(about.white < 0.05);          /* a tenth is at the clip */
    CHECK_NEAR(about.mean, 0.79, 0.01); /* of those below it alone .767 */
    uint8_t *before = mem_array(PIXELS, 1);
    memcpy(before, photograph[0].saturated, PIXELS);
    clip_mark(&scene, &views, &noise, pool);
    CHECK_THAT(memcmp(before, photograph[0].saturated, PIXELS) == 0, "the same when it is done again");
    mem_free(before);
    parallel_free(pool);
    for (uint32_t t = 0; t < PHOTOGRAPHS; t++)
        photograph_release(&photograph[t]);
    return check_result();
}
