/* exr_unzip.c -- see exr_unzip.h. The predictor and the order of bytes are those of EXR's ZIP compression (OpenEXR File
 * Layout). */
#include "common/exr_unzip.h"

#include <zlib.h>

#include "common/mem.h"

/* RFC 1950, section 2.2: deflate in the low bits, and a multiple of 31. */
static bool starts_like_zlib(const uint8_t *data, size_t size) {
    return size > 6 && (data[0] & 0x8f) == 0x08 && (data[0] << 8 | data[1]) % 31 == 0;
}

bool exr_unzip(const uint8_t *data, size_t size, uint8_t *out) {
    if (!starts_like_zlib(data, size))
        return false;
    uint8_t *split = mem_alloc(size);
    uLongf length = size;
    uLong used = size;
    int result = uncompress2(split, &length, data, &used);
    if (result == Z_MEM_ERROR)
        mem_exhausted("zlib");
    bool is_stream = result == Z_OK && length == size && used == size;
    for (size_t i = 1; is_stream && i < size; i++)
        split[i] = (uint8_t)(split[i - 1] + split[i] - 128);
    for (size_t i = 0; is_stream && i < size; i++)
        out[i] = split[i % 2 ? (size + 1) / 2 + i / 2 : i / 2];
    mem_free(split);
    return is_stream;
}
