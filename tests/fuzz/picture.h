/* picture.h -- what all picture readers must do with any bytes: answer with a status, and with
 * "ok" only when every pixel can be read. */
#ifndef UNBAKE_TESTS_FUZZ_PICTURE_H
#define UNBAKE_TESTS_FUZZ_PICTURE_H

#include <unistd.h>

#include "common/image.h"
#include "tests/fuzz/fuzz.h"

#define READ_MAX ((size_t)1 << 20)

static volatile float picture_sum; /* so that the reading is not left out */

static inline void picture_read(const uint8_t *data, size_t size) {
    struct image image;
    struct image_info info;
    struct error err = {.message = ""};
    enum status status = image_read_memory("case", data, size, &image, &info, &err);
    if (status == STATUS_OK) {
        MUST(image.width > 0 && image.height > 0 && image.channel_count > 0);
        MUST(info.orientation >= 1 && info.orientation <= 8);
        size_t count = (size_t)image.width * image.height * image.channel_count;
        /* Of a picture that is nearly all empty, which takes a few bytes, only some: it would take a minute. */
        size_t step = count / READ_MAX + 1;
        float sum = image.pixel[count - 1];
        for (size_t i = 0; i < count; i += step)
            sum += image.pixel[i];
        picture_sum = sum;
    } else {
        MUST(status == STATUS_INPUT || status == STATUS_LIMIT);
        MUST(err.message[0] != '\0');
        MUST(image.pixel == NULL && image.channel == NULL);
    }
    image_release(&image);
}

/* A small picture, as `write` puts it into a file. */
static inline void picture_seed(struct seeds *s, uint32_t channel_count,
                                enum status (*write)(const char *path, const struct image *image)) {
    static const char *const channels[] = {"R", "G", "B", "A", "id"};
    struct image image;
    char path[256];
    snprintf(path, sizeof path, "%s/picture", fuzz_folder());
    image_init(&image, 70, 20, channel_count, channels);
    for (size_t i = 0; i < (size_t)70 * 20 * channel_count; i++)
        image.pixel[i] = (float)(i % 37) / 37.0f;
    MUST(write(path, &image) == STATUS_OK);
    seeds_path(s, path, "");
    image_release(&image);
}

#endif
