/* image_rig.h -- pictures that are read or refused. */
#ifndef UNBAKE_TESTS_UNIT_IMAGE_RIG_H
#define UNBAKE_TESTS_UNIT_IMAGE_RIG_H

#include "common/image.h"
#include "tests/check.h"

static struct error err;
static char scratch[64];

static inline float at(const struct image *image, uint32_t x, uint32_t y, uint32_t c) {
    return image->pixel[((size_t)y * image->width + x) * image->channel_count + c];
}

/* Reads the file or reports that it did not. */
static inline bool reads(const char *path, struct image *image, struct image_info *info) {
    enum status status = image_read(path, image, info, &err);
    CHECK_THAT(status == STATUS_OK, "%s", err.message);
    return status == STATUS_OK;
}

static inline void check_refused(const char *path, const char *part_of_message) {
    struct image image;
    enum status status = image_read(path, &image, NULL, &err);
    CHECK_THAT(status == STATUS_INPUT, "%s gives status %s", path, status_name(status));
    CHECK_THAT(status == STATUS_OK || strstr(err.message, part_of_message), "%s", err.message);
    image_release(&image);
}

#endif
