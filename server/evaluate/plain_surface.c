/* plain_surface.c -- see plain_surface.h. */
#include "server/evaluate/plain_surface.h"

#include <math.h>
#include <stdbool.h>

#include "common/vec.h"
#include "server/evaluate/pair_picture.h"
#include "server/evaluate/score.h"

#define RADIUS 2 /* pixels, of the 5 x 5 window: specks are of 1 to 3 */
/* Base colours of the truth that differ less are of one plain surface: mottled paint, not print. With .002 the demo
 * room has 705 such pixels in 8 views, nearly all of paintings; with .03 it has 36,759, nearly all of walls. */
#define SAME_COLOR 0.03f
#define WINDOW ((2 * RADIUS + 1) * (2 * RADIUS + 1))

static const float *pixel_at(const struct image *image, uint32_t x, uint32_t y) {
    return image->pixel + ((size_t)y * image->width + x) * image->channel_count;
}

/* Whether the window shows one plain surface of the truth, seen in all its pixels; mean[] is then found's error over
 * it. */
static bool is_plain(const struct image *found, const struct image *truth, const uint8_t *flags, uint32_t x, uint32_t y,
                     double mean[3]) {
    struct rgb_columns tc = pair_picture_columns(truth, "base_color."), fc = pair_picture_columns(found, "base_color.");
    int object = image_channel(truth, "object_id");
    const float *centre = pixel_at(truth, x, y);
    mean[0] = mean[1] = mean[2] = 0.0;
    for (uint32_t j = y - RADIUS; j <= y + RADIUS; j++) {
        for (uint32_t i = x - RADIUS; i <= x + RADIUS; i++) {
            const float *t = pixel_at(truth, i, j), *f = pixel_at(found, i, j);
            if (!(flags[(size_t)j * truth->width + i] & SCORE_SEEN) || t[object] != centre[object])
                return false;
            for (int c = 0; c < 3; c++) {
                if (fabsf(t[tc.at[c]] - centre[tc.at[c]]) > SAME_COLOR)
                    return false;
                mean[c] += ((double)f[fc.at[c]] - (double)t[tc.at[c]]) / WINDOW;
            }
        }
    }
    return true;
}

static void add_pixel(struct plain_surface *plain, const struct image *found, const struct image *truth,
                      const uint8_t *flags, uint32_t x, uint32_t y) {
    double mean[3], most = 0.0;
    struct rgb_columns fc = pair_picture_columns(found, "base_color."), tc = pair_picture_columns(truth, "base_color.");
    if (x < RADIUS || y < RADIUS || x + RADIUS >= truth->width || y + RADIUS >= truth->height ||
        !is_plain(found, truth, flags, x, y, mean))
        return;
    for (int c = 0; c < 3; c++) {
        double error = (double)pixel_at(found, x, y)[fc.at[c]] - (double)pixel_at(truth, x, y)[tc.at[c]];
        double off = error - mean[c];
        plain->squares += off * off;
        most = fmax(most, fabs(off));
    }
    plain->pixels++;
    plain->specks += most > (double)PLAIN_SURFACE_SPECK;
}

void plain_surface_add(struct plain_surface *plain, const struct image *found, const struct image *truth,
                       const uint8_t *flags) {
    for (uint32_t y = 0; y < truth->height; y++)
        for (uint32_t x = 0; x < truth->width; x++)
            if (flags[(size_t)y * truth->width + x] & SCORE_SEEN)
                add_pixel(plain, found, truth, flags, x, y);
}

double plain_surface_spread(const struct plain_surface *plain) {
    return plain->pixels ? sqrt(plain->squares / (3.0 * (double)plain->pixels)) : (double)NAN;
}
