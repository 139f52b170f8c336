/* color_rig.h -- pictures read back and compared in linear light. */
#ifndef UNBAKE_TESTS_UNIT_COLOR_RIG_H
#define UNBAKE_TESTS_UNIT_COLOR_RIG_H

#include "common/image.h"
#include "tests/unit/profiles.h"

static struct error err;
static char scratch[] = "/tmp/unbake-test-color-XXXXXX";

/* The columns: what Display P3's red, green and blue are in Rec. 709. */
static const double p3[3][3] = {{1.2249, -0.2249, 0.0}, {-0.0420, 1.0420, 0.0}, {-0.0196, -0.0786, 1.0983}};

static inline double srgb(double stored) { return (double)image_srgb_to_linear((float)stored); }

static inline bool read_bytes(const struct buf *file, struct image *image, struct image_info *info) {
    enum status status = image_read_memory("case", file->data, file->length, image, info, &err);
    CHECK_THAT(status == STATUS_OK, "%s", err.message);
    return status == STATUS_OK;
}

/* One pixel, in linear light whatever the encoding. */
static inline void pixel_is(const struct image *image, const struct image_info *info, size_t i, double r, double g,
                            double b, double tolerance) {
    for (size_t c = 0; c < 3; c++) {
        double value = (double)image->pixel[i * image->channel_count + c];
        CHECK_NEAR(info->encoding == IMAGE_SRGB ? srgb(value) : value, c == 0 ? r : c == 1 ? g : b, tolerance);
    }
}

static const uint16_t pixels8[12] = {255, 0, 0, 0, 255, 0, 200, 150, 100, 255, 255, 255};

static inline void png_with(const struct buf *profile, struct buf *file) {
    png_begin(file, 4, 8, 2);
    png_iccp(file, profile);
    png_end(file, pixels8, 12, 8);
}

#endif
