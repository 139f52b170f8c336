/* test_heif.c -- the HEIC and AVIF reader. */
#include "tests/fuzz/picture.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size >= 12 && memcmp(data + 4, "ftyp", 4) == 0)
        picture_read(data, size);
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    s->mutants = 1500;
    seeds_path(s, "tests/data/image", ".heic");
    seeds_path(s, "tests/data/image", ".avif");
    seeds_data(s, "captures/ph_heic/images", "000.heic");
}
