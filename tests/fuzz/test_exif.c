/* test_exif.c -- the EXIF block of a JPEG or PNG, without the picture around it. */
#include "common/image_codec.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct image_info info = {.orientation = 1};
    image_parse_exif(data, size, &info);
    MUST(info.orientation >= 1 && info.orientation <= 8);
    MUST(info.exposure_time_sec >= 0 && info.iso >= 0 && info.f_number >= 0);
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    /* IFD0: orientation 6, the Exif IFD at 38; there: time 1/100 at 68, f-number at 76, ISO 200. */
    static const char little[] = "II*\0\10\0\0\0"
                                 "\2\0"
                                 "\x12\1\3\0\1\0\0\0\6\0\0\0"
                                 "\x69\x87\4\0\1\0\0\0\46\0\0\0"
                                 "\0\0\0\0"
                                 "\3\0"
                                 "\x9a\x82\5\0\1\0\0\0\120\0\0\0"
                                 "\x9d\x82\5\0\1\0\0\0\130\0\0\0"
                                 "\x27\x88\3\0\1\0\0\0\310\0\0\0"
                                 "\0\0\0\0"
                                 "\1\0\0\0\144\0\0\0"
                                 "\34\0\0\0\12\0\0\0";
    static const char big[] = "MM\0*\0\0\0\10"
                              "\0\1"
                              "\x87\x69\0\4\0\0\0\1\0\0\0\32"
                              "\0\0\0\0"
                              "\0\2"
                              "\x88\x33\0\4\0\0\0\1\0\0\1\220"
                              "\x88\x31\0\4\0\0\0\1\0\0\0\144"
                              "\0\0\0\0";
    s->mutants = 10000;
    seeds_add(s, little, sizeof little - 1);
    seeds_add(s, big, sizeof big - 1);
}
