/* test_image_exr.c -- EXR: values that OpenEXR's Python module 3.4 reads from the same files, round trips through our
 * writer, order of channels, windows. */
#include <dirent.h>
#include <stdint.h>
#include <sys/stat.h>

#include "common/rng.h"
#include "tests/unit/image_rig.h"

/* ---------------------------------------------------------------------------------- EXR */

static void exr_round_trip(uint32_t channel_count, enum image_exr_type type, bool tiled) {
    static const char *const names[] = {"id", "A", "B", "G", "R"};
    static const char *const sorted[] = {"R", "G", "B", "A", "id"};
    struct image image, back;
    struct image_info info;
    image_init(&image, 131, 77, channel_count, names);
    size_t count = (size_t)131 * 77 * channel_count;
    for (size_t i = 0; i < count; i++)
        image.pixel[i] = (float)(i % 997) * 0.731f - 100 * (float)(i % channel_count);
    image.pixel[5] = INFINITY;
    CHECK(image_write_exr(scratch, &image, type, tiled, &err) == STATUS_OK);
    if (reads(scratch, &back, &info)) {
        CHECK(back.width == 131 && back.height == 77 && back.channel_count == channel_count);
        CHECK(info.encoding == IMAGE_LINEAR && info.bits == (type == IMAGE_HALF ? 16 : 32));
        CHECK(info.orientation == 1 && info.exposure_time_sec == 0);
        for (uint32_t c = 0; c < channel_count; c++) {
            int from = image_channel(&image, back.channel[c]);
            CHECK(channel_count < 5 || strcmp(back.channel[c], sorted[c]) == 0);
            size_t wrong = 0;
            for (size_t i = 0; from >= 0 && i < (size_t)131 * 77; i++) {
                float wanted = image.pixel[i * channel_count + (size_t)from];
                if (type == IMAGE_HALF)
                    wanted = image_float_from_half(image_half_from_float(wanted));
                wrong += back.pixel[i * channel_count + c] != wanted;
            }
            CHECK_THAT(from >= 0 && wrong == 0, "channel %s: %zu", back.channel[c], wrong);
        }
        image_release(&back);
    }
    image_release(&image);
}

static void exr_same_bytes(void) {
    struct image image;
    image_init_rgb(&image, 100, 100);
    for (size_t i = 0; i < 30000; i++)
        image.pixel[i] = sinf((float)i);
    for (int tiled = 0; tiled < 2; tiled++) {
        char *bytes[2] = {malloc(1 << 18), malloc(1 << 18)};
        size_t size[2];
        for (int k = 0; k < 2; k++) {
            CHECK(image_write_exr(scratch, &image, IMAGE_HALF, tiled, &err) == STATUS_OK);
            FILE *file = fopen(scratch, "rb");
            size[k] = file ? fread(bytes[k], 1, 1 << 18, file) : 0;
            if (file)
                fclose(file);
        }
        CHECK(size[0] > 1000 && size[0] == size[1] && memcmp(bytes[0], bytes[1], size[0]) == 0);
        free(bytes[0]);
        free(bytes[1]);
    }
    image_release(&image);
    CHECK(image_write_exr("/nonexistent/a.exr", &image, IMAGE_HALF, false, &err) == STATUS_NOT_FOUND);
}

static void exr_disk_full(void) {
    static const char *const names[] = {"Y"};
    struct image image;
    image_init(&image, 64, 64, 1, names);
    if (access("/dev/full", W_OK) == 0) {
        CHECK(image_write_exr("/dev/full", &image, IMAGE_FLOAT, true, &err) == STATUS_NO_SPACE);
        CHECK(image_write_png("/dev/full", &image, 1, &err) == STATUS_NO_SPACE);
    }
    image_release(&image);
}

/* Small files of every kind, made by OpenEXR's Python module: channels R, G, B hold
 * 10 * row + column, the same plus 100, plus 200; 20 x 12 pixels of data at (3, 2). */
static void exr_kinds(void) {
    static const char *const compressions[] = {"no", "rle", "zips", "zip", "piz", "pxr24"};
    struct image image;
    for (size_t i = 0; i < sizeof compressions / sizeof compressions[0]; i++) {
        char path[64];
        snprintf(path, sizeof path, "tests/data/image/%s.exr", compressions[i]);
        if (!reads(path, &image, NULL))
            continue;
        CHECK(image.width == 25 && image.height == 15 && image.channel_count == 4);
        CHECK(at(&image, 3, 2, 0) == 0 && at(&image, 22, 13, 0) == 129);
        CHECK(at(&image, 4, 3, 1) == 111 && at(&image, 4, 3, 2) == 211);
        CHECK(at(&image, 3, 2, 3) == 1 && at(&image, 2, 2, 3) == 0 && at(&image, 23, 2, 3) == 0);
        image_release(&image);
    }
    if (reads("tests/data/image/parts.exr", &image, NULL)) { /* Z alone, then RGB tiled, half */
        CHECK(image.channel_count == 3 && image.width == 20 && at(&image, 19, 11, 2) == 329);
        image_release(&image);
    }
    if (reads("tests/data/image/overscan.exr", &image, NULL)) { /* shows x 8 to 12, y 4 to 6 */
        CHECK(image.width == 5 && image.height == 3);
        CHECK(at(&image, 0, 0, 0) == 25 && at(&image, 4, 2, 0) == 49);
        image_release(&image);
    }
    if (reads("tests/data/image/grey_uint.exr", &image, NULL)) { /* Y half and id uint */
        CHECK(image.channel_count == 4 && image_channel(&image, "id") == 3);
        CHECK(at(&image, 1, 1, 0) == 11 && at(&image, 1, 1, 2) == 11);
        CHECK(at(&image, 19, 11, 3) == 1000129);
        image_release(&image);
    }
    if (reads("tests/data/image/ripmap.exr", &image, NULL)) {
        CHECK(image.width == 20 && image.height == 12 && at(&image, 19, 11, 1) == 229);
        image_release(&image);
    }
    check_refused("tests/data/image/dwaa.exr", "DWAA");
    CHECK(err.hint[0] != '\0');
    check_refused("tests/data/image/b44_float.exr", "B44");
    check_refused("tests/data/image/chroma.exr", "subsampled");
    check_refused("tests/data/image/apart.exr", "outside");
}

int main(void) {
    snprintf(scratch, sizeof scratch, "/tmp/unbake-image-exr-%d", (int)getpid());
    for (uint32_t channel_count = 1; channel_count <= 5; channel_count++)
        for (int kind = 0; kind < 4; kind++)
            exr_round_trip(channel_count, kind & 1 ? IMAGE_FLOAT : IMAGE_HALF, kind & 2);
    exr_same_bytes();
    exr_disk_full();
    exr_kinds();
    return check_result();
}
