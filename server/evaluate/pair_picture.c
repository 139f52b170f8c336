/* pair_picture.c -- see pair_picture.h. */
#include "server/evaluate/pair_picture.h"

#include <stdio.h>

struct rgb_columns pair_picture_columns(const struct image *image, const char *prefix) {
    struct rgb_columns columns;
    for (int c = 0; c < 3; c++) {
        char name[64];
        snprintf(name, sizeof name, "%s%c", prefix, "RGB"[c]);
        columns.at[c] = image_channel(image, name);
    }
    return columns;
}

enum status pair_picture_write(const char *path, const struct image *a, const struct image *b, const char *prefix,
                               float scale, struct error *err) {
    enum { GAP = 4 };
    struct image pair;
    const struct image *side[2] = {a, b};
    image_init_rgb(&pair, 2 * a->width + GAP, a->height);
    for (int k = 0; k < 2; k++) {
        struct rgb_columns columns = pair_picture_columns(side[k], prefix);
        for (uint32_t y = 0; y < a->height; y++) {
            for (uint32_t x = 0; x < a->width; x++) {
                size_t to = (size_t)y * pair.width + x + (k ? a->width + GAP : 0);
                const float *from = side[k]->pixel + ((size_t)y * a->width + x) * side[k]->channel_count;
                for (int c = 0; c < 3; c++)
                    pair.pixel[3 * to + (size_t)c] = from[columns.at[c]];
            }
        }
    }
    enum status status = image_write_png(path, &pair, scale, err);
    image_release(&pair);
    return status;
}
