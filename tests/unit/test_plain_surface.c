/* test_plain_surface.c -- specks on plain surface are what is found, not what the truth has: mottled paint counts,
 * print does not. */
#include "server/evaluate/plain_surface.h"

#include <stdlib.h>

#include "server/evaluate/score.h"
#include "tests/check.h"

#define SIDE 20

static const char *const names[] = {"base_color.R", "base_color.G", "base_color.B", "object_id"};

static float *pixel(struct image *image, int x, int y) {
    return image->pixel + ((size_t)y * SIDE + (size_t)x) * image->channel_count;
}

int main(void) {
    struct image truth, found;
    struct plain_surface plain = {0};
    uint8_t flags[SIDE * SIDE];
    image_init(&truth, SIDE, SIDE, 4, names);
    image_init(&found, SIDE, SIDE, 3, names);
    memset(flags, SCORE_SEEN, sizeof flags);
    for (int i = 0; i < SIDE * SIDE; i++) { /* mottled by .02; printed in the left half of the lower part */
        int x = i % SIDE, y = i / SIDE;
        bool is_print = y >= SIDE / 2 && x < SIDE / 2 && (x + y) % 2 == 0;
        for (int c = 0; c < 3; c++) {
            float t = is_print ? 0.2f : 0.5f + (float)((x * 7 + y * 3) % 5) * 0.005f;
            pixel(&truth, x, y)[c] = t;
            pixel(&found, x, y)[c] = 0.9f * t;
        }
    }
    pixel(&found, 15, 5)[1] += 0.1f; /* a speck on the wall, and one in print */
    pixel(&found, 4, 15)[1] += 0.1f;
    plain_surface_add(&plain, &found, &truth, flags);
    size_t all = (SIDE - 4) * (SIDE - 4),
           in_print =
               10 * 10 - 1; /* windows that touch columns 0 to 9, rows 10 to 19; of one the corner, which is bare */
    CHECK_THAT(plain.pixels == all - in_print, "%zu", plain.pixels);
    CHECK_THAT(plain.specks == 1, "%zu", plain.specks);
    double spread = plain_surface_spread(&plain);
    CHECK_THAT(spread > 0.002 && spread < 0.006, "%g",
               spread); /* .1 in one channel of one of 156 pixels; little else */
    image_release(&truth);
    image_release(&found);
    return check_result();
}
