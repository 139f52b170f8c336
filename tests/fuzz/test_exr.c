/* test_exr.c -- the OpenEXR reader. */
#include "tests/fuzz/picture.h"

/* The choice among layers, of the header only: what follows is the same. */
static void read_layers(const uint8_t *data, size_t size) {
    struct image image;
    struct error err;
    char path[256];
    snprintf(path, sizeof path, "%s/case", fuzz_folder());
    fuzz_write(path, data, size);
    if (image_probe_photograph(path, &image, NULL, &err) == STATUS_OK)
        MUST(image.channel_count == 3 || image.channel_count == 4);
    image_release(&image);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size >= 4 && memcmp(data, "\x76\x2f\x31\x01", 4) == 0)
        picture_read(data, size), read_layers(data, size);
    return 0;
}

static enum status write_float(const char *path, const struct image *image) {
    return image_write_exr(path, image, IMAGE_FLOAT, false, NULL);
}

static enum status write_half(const char *path, const struct image *image) {
    return image_write_exr(path, image, IMAGE_HALF, false, NULL);
}

static enum status write_tiled(const char *path, const struct image *image) {
    return image_write_exr(path, image, IMAGE_HALF, true, NULL);
}

void fuzz_seeds(struct seeds *s) {
    s->mutants = 2000;
    picture_seed(s, 1, write_float);
    picture_seed(s, 5, write_half);
    picture_seed(s, 4, write_tiled);
    seeds_path(s, "tests/data/image", ".exr");
    seeds_data(s, "captures/exr_blender_multilayer/images", "000.exr");
    seeds_data(s, "vectors/exr-tinyexr", "");
    seeds_data(s, "vectors/exr-damaged", "");
}
