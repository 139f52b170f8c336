/* test_hdr.c -- the Radiance reader. */
#include "tests/fuzz/picture.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size >= 2 && memcmp(data, "#?", 2) == 0)
        picture_read(data, size);
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    static const char coded[] = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2\n\n-Y 2 +X 8\n"
                                "\2\2\0\10\210\7\210\7\210\7\210\200\2\2\0\10"
                                "\10abcdefgh\210\7\210\7\210\200";
    static const char flat[] = "#?RGBE\n\n-Y 1 +X 6\nabc\200\1\1\1\3bcd\201\1\1\1\1";
    s->mutants = 5000;
    seeds_add(s, coded, sizeof coded - 1);
    seeds_add(s, flat, sizeof flat - 1);
}
