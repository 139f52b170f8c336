/* test_jpeg.c -- the JPEG reader, and what it finds of EXIF. */
#include "tests/fuzz/picture.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size >= 2 && data[0] == 0xff && data[1] == 0xd8)
        picture_read(data, size);
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    s->mutants = 1500;
    seeds_path(s, "tests/data/image", ".jpg");
    seeds_data(s, "vectors/assimp/OBJ", ".jpg");
    seeds_data(s, "captures/icc_p3/images", ".jpg");
}
