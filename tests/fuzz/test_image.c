/* test_image.c -- the picture readers on damaged files: they must answer with a status, and an
 * answer of "ok" must come with pixels that can all be read. */
#include "common/image.h"

#include <zlib.h>

#include "tests/fuzz/mutate.h"

static volatile float sink;

/* Makes the checksums of a PNG right again: with wrong ones nothing behind them is reached. */
static void repair_png(uint8_t *data, size_t size) {
    for (size_t at = 8; at + 12 <= size;) {
        size_t length = (size_t)data[at] << 24 | (size_t)data[at + 1] << 16 |
                        (size_t)data[at + 2] << 8 | data[at + 3];
        if (length > size - at - 12)
            return;
        uint8_t *sum = data + at + 8 + length;
        uint32_t crc = (uint32_t)crc32(0, data + at + 4, (uInt)length + 4);
        for (int i = 0; i < 4; i++)
            sum[i] = (uint8_t)(crc >> (24 - 8 * i));
        at += 12 + length;
    }
}

static void parse(const uint8_t *data, size_t size) {
    struct image image;
    struct image_info info;
    struct error err = {.message = ""};
    enum status status = image_read_memory("case", data, size, &image, &info, &err);
    if (status == STATUS_OK) {
        CHECK(image.width > 0 && image.height > 0 && image.channel_count > 0);
        CHECK(info.orientation >= 1 && info.orientation <= 8);
        size_t count = (size_t)image.width * image.height * image.channel_count;
        float sum = 0;
        for (size_t i = 0; i < count; i++)
            sum += image.pixel[i];
        sink = sum;
    } else {
        CHECK(status == STATUS_INPUT || status == STATUS_LIMIT);
        CHECK(err.message[0] != '\0');
        CHECK(image.pixel == NULL && image.channel == NULL);
    }
    image_release(&image);
}

static void target(const uint8_t *data, size_t size) {
    parse(data, size);
    if (size < 4 || memcmp(data, "\x89PNG", 4) != 0)
        return;
    uint8_t *repaired = malloc(size);
    memcpy(repaired, data, size);
    repair_png(repaired, size);
    parse(repaired, size);
    free(repaired);
}

/* Each kind of file that the writers make, small, and what they do not make by hand. */
static void add_written(struct mutate *m) {
    static const char *const channels[] = {"R", "G", "B", "A", "id"};
    char path[] = "/tmp/unbake-fuzz-XXXXXX";
    int fd = mkstemp(path);
    if (fd >= 0)
        close(fd);
    for (uint32_t kind = 0; kind < 5; kind++) {
        struct image image;
        image_init(&image, 70, 20, kind + 1, channels);
        for (size_t i = 0; i < (size_t)70 * 20 * (kind + 1); i++)
            image.pixel[i] = (float)(i % 37) / 37.0f;
        if (kind < 4)
            image_write_exr(path, &image, kind & 1 ? IMAGE_HALF : IMAGE_FLOAT, kind & 2, NULL);
        else
            image_write_png(path, &image, 1, NULL);
        mutate_add_path(m, path, "");
        image_release(&image);
    }
    unlink(path);
    static const char radiance[] = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2\n\n-Y 2 +X 8\n"
                                   "\2\2\0\10\210\7\210\7\210\7\210\200\2\2\0\10"
                                   "\10abcdefgh\210\7\210\7\210\200";
    mutate_add_bytes(m, radiance, sizeof radiance - 1);
    static const char flat[] = "#?RGBE\n\n-Y 1 +X 6\nabc\200\1\1\1\3bcd\201\1\1\1\1";
    mutate_add_bytes(m, flat, sizeof flat - 1);
}

int main(int argc, char **argv) {
    static struct mutate m;
    mutate_init(&m);
    add_written(&m);
    mutate_add_path(&m, "tests/data/image", "");
    mutate_add(&m, "vectors/png-suite", ".png");
    mutate_add(&m, "vectors/exr-tinyexr", "");
    mutate_add(&m, "vectors/exr-damaged", "");
    mutate_add(&m, "vectors/assimp/OBJ", ".jpg");
    return mutate_run(&m, argc, argv, 6000, target);
}
