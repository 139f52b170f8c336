/* patches.h -- a picture of six patches, in files of any format. */
#ifndef UNBAKE_TESTS_UNIT_PATCHES_H
#define UNBAKE_TESTS_UNIT_PATCHES_H

#include "common/image.h"
#include "tests/unit/profiles.h"

#define WIDTH 48
#define HEIGHT 32 /* patches of 16 x 16 */

static const float patch[6][3] = {{.8f, .2f, .2f}, {.2f, .7f, .3f}, {.2f, .3f, .8f},
                                  {.5f, .5f, .5f}, {1, 1, 1},       {.1f, .1f, .1f}};
static struct error err;
static char scratch[64];

static inline bool reads(const char *path, struct image *image, struct image_info *info) {
    enum status status = image_read(path, image, info, &err);
    CHECK_THAT(status == STATUS_OK, "%s", err.message);
    return status == STATUS_OK;
}

static inline const float *middle(const struct image *image, int i) {
    return image->pixel + ((size_t)(i / 3 * 16 + 8) * image->width + (size_t)(i % 3 * 16 + 8)) * image->channel_count;
}

/* Every patch holds its colour to `tolerance`, times `scale`. */
static inline void check_patches(const char *what, const struct image *image, double scale, double tolerance) {
    CHECK_THAT(image->width == WIDTH && image->height == HEIGHT, "%s: %u x %u", what, image->width, image->height);
    for (int i = 0; i < 6 && image->width == WIDTH; i++)
        for (int c = 0; c < 3; c++) {
            double found = (double)middle(image, i)[c], wanted = scale * (double)patch[i][c];
            CHECK_THAT(fabs(found - wanted) <= tolerance, "%s: patch %d, channel %d: %g, wanted %g", what, i, c, found,
                       wanted);
        }
}

static inline void check_refused(const char *path, const char *part) {
    struct image image;
    enum status status = image_read(path, &image, NULL, &err);
    CHECK_THAT(status == STATUS_INPUT && strstr(err.message, part), "%s: %s", path, status ? err.message : "is read");
    image_release(&image);
}

/* No beginning of the file is a picture. `tail`: last bytes that hold no pixels. */
static inline void cut_short(const char *path, size_t tail) {
    static unsigned char bytes[1 << 20];
    FILE *file = fopen(path, "rb");
    size_t size = file ? fread(bytes, 1, sizeof bytes, file) : 0;
    if (file)
        fclose(file);
    CHECK_THAT(size > 20 && size < sizeof bytes, "%s", path);
    for (size_t cut = 0; cut + tail < size; cut += 1 + size / 100) {
        struct image image;
        enum status status = image_read_memory("cut", bytes, cut, &image, NULL, &err);
        CHECK_THAT(status == STATUS_INPUT, "%s cut to %zu of %zu bytes", path, cut, size);
        image_release(&image);
    }
}

#endif
