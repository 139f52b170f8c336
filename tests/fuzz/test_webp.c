/* test_webp.c -- the WebP reader. */
#include <webp/encode.h>

#include "tests/fuzz/picture.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size >= 12 && memcmp(data + 8, "WEBP", 4) == 0)
        picture_read(data, size);
    return 0;
}

static void add(struct seeds *s, size_t (*encode)(const uint8_t *, int, int, int, uint8_t **)) {
    static uint8_t pixels[20 * 30 * 4];
    uint8_t *out = NULL;
    for (size_t i = 0; i < sizeof pixels; i++)
        pixels[i] = (uint8_t)(i * i / 7);
    size_t size = encode(pixels, 20, 30, 80, &out);
    MUST(size > 0);
    seeds_add(s, out, size);
    WebPFree(out);
}

static size_t encode_lossy(const uint8_t *pixels, int width, int height, int stride, uint8_t **out) {
    return WebPEncodeRGBA(pixels, width, height, stride, 80, out);
}

void fuzz_seeds(struct seeds *s) {
    s->mutants = 3000;
    add(s, encode_lossy);
    add(s, WebPEncodeLosslessRGBA);
    seeds_data(s, "captures/ph_webp/images", "000.webp");
}
