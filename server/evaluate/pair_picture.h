/* pair_picture.h -- two pictures side by side, to look at. */
#ifndef UNBAKE_EVALUATE_PAIR_PICTURE_H
#define UNBAKE_EVALUATE_PAIR_PICTURE_H

#include "common/error.h"
#include "common/image.h"

/* The channels of red, green and blue; -1: there is none. Files list channels by name: B comes before R. */
struct rgb_columns {
    int at[3];
};

/* The channels prefixR, prefixG and prefixB. */
struct rgb_columns pair_picture_columns(const struct image *image, const char *prefix);

/* Writes `a` beside `b`, which is of its size, as an 8-bit PNG: of each the channels of pair_picture_columns, times
 * `scale`. */
enum status pair_picture_write(const char *path, const struct image *a, const struct image *b, const char *prefix,
                               float scale, struct error *err);

#endif
