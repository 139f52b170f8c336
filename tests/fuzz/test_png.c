/* test_png.c -- the PNG reader. */
#include <zlib.h>

#include "tests/fuzz/picture.h"

/* Makes the checksums right again: with wrong ones nothing behind them is reached. */
static void repair(uint8_t *data, size_t size) {
    for (size_t at = 8; at + 12 <= size;) {
        size_t length = (size_t)data[at] << 24 | (size_t)data[at + 1] << 16 | (size_t)data[at + 2] << 8 | data[at + 3];
        if (length > size - at - 12)
            return;
        uint8_t *sum = data + at + 8 + length;
        uint32_t crc = (uint32_t)crc32(0, data + at + 4, (uInt)length + 4);
        for (int i = 0; i < 4; i++)
            sum[i] = (uint8_t)(crc >> (24 - 8 * i));
        at += 12 + length;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size < 8 || memcmp(data, "\x89PNG\r\n\x1a\n", 8) != 0)
        return 0;
    picture_read(data, size);
    uint8_t *repaired = malloc(size);
    memcpy(repaired, data, size);
    repair(repaired, size);
    picture_read(repaired, size);
    free(repaired);
    return 0;
}

static enum status write_png(const char *path, const struct image *image) {
    return image_write_png(path, image, 1, NULL);
}

void fuzz_seeds(struct seeds *s) {
    s->mutants = 3000;
    picture_seed(s, 3, write_png);
    seeds_path(s, "tests/data/image", ".png");
    seeds_data(s, "vectors/png-suite", ".png");
    seeds_data(s, "captures/png16_linear_gama/images", ".png");
}
