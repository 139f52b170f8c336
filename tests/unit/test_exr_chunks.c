/* test_exr_chunks.c -- EXR chunks that do not become smaller. A reader takes a chunk whose size in the file is that of
 * its pixels for pixels as they are (OpenEXR File Layout, "Pixel data"), so a zlib stream of just that size must not be
 * written; libraries up to OpenEXR 3.4.6 do (their issue 2306). */
#include <fcntl.h>
#include <openexr.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <zlib.h>

#include "common/buf.h"
#include "common/file.h"
#include "common/image.h"
#include "common/rng.h"
#include "tests/check.h"

static char scratch[] = "/tmp/unbake-test-chunks-XXXXXX";
static struct error err;

enum { WIDTH = 37, HEIGHT = 13, CHANNELS = 3, PIXELS = WIDTH * HEIGHT, ZIP_LEVEL = 4 };

#define RAW_MAX (PIXELS * CHANNELS * sizeof(float))

static size_t raw_size(enum image_exr_type type) { return (size_t)PIXELS * CHANNELS * (type == IMAGE_HALF ? 2 : 4); }

/* The chunk as EXR packs it: line by line, in each the channels in the order of their names. */
static void pack(const struct image *image, enum image_exr_type type, uint8_t *out) {
    static const int order[CHANNELS] = {2, 1, 0}; /* B G R */
    for (size_t y = 0; y < HEIGHT; y++)
        for (size_t c = 0; c < CHANNELS; c++)
            for (size_t x = 0; x < WIDTH; x++) {
                float value = image->pixel[(y * WIDTH + x) * CHANNELS + (size_t)order[c]];
                uint16_t half = image_half_from_float(value);
                size_t size = type == IMAGE_HALF ? sizeof half : sizeof value;
                memcpy(out, type == IMAGE_HALF ? (const void *)&half : (const void *)&value, size);
                out += size;
            }
}

/* What EXR's ZIP makes of it before zlib: even bytes, then odd ones, then differences. */
static size_t deflate_chunk(const uint8_t *raw, size_t size, uint8_t *out, size_t room) {
    uint8_t split[RAW_MAX];
    for (size_t i = 0; i < size; i++)
        split[i % 2 ? (size + 1) / 2 + i / 2 : i / 2] = raw[i];
    for (size_t i = size - 1; i > 0; i--)
        split[i] = (uint8_t)(split[i] - split[i - 1] + 128);
    uLongf length = room;
    CHECK(compress2(out, &length, split, size, ZIP_LEVEL) == Z_OK);
    return length;
}

/* Noise, but for the first `quiet` values: more of these make the chunk smaller. */
static void fill(struct image *image, uint64_t seed, size_t quiet) {
    for (size_t i = 0; i < (size_t)PIXELS * CHANNELS; i++) {
        uint64_t random = i < quiet ? 0 : rng_key(seed, i, 0);
        uint32_t bits = (uint32_t)(random & 0x807fffff) | (112u + (uint32_t)(random >> 32) % 30) << 23;
        memcpy(&image->pixel[i], &bits, sizeof bits); /* finite as a half, too */
    }
}

/* The one chunk of the file as it is stored; returns its size, 0 where it cannot be read. */
static size_t stored_chunk(bool tiled, uint8_t *out, size_t room) {
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    exr_context_t context;
    exr_chunk_info_t chunk = {0};
    if (exr_start_read(&context, scratch, &init) != EXR_ERR_SUCCESS)
        return 0;
    exr_result_t code = tiled ? exr_read_tile_chunk_info(context, 0, 0, 0, 0, 0, &chunk)
                              : exr_read_scanline_chunk_info(context, 0, 0, &chunk);
    if (code == EXR_ERR_SUCCESS && chunk.packed_size <= room)
        code = exr_read_chunk(context, 0, &chunk, out);
    exr_finish(&context);
    return code == EXR_ERR_SUCCESS ? (size_t)chunk.packed_size : 0;
}

/* Writes the picture and looks at it by the format's own rule and by the reader. */
static void check_file(const struct image *image, enum image_exr_type type, bool tiled, const uint8_t *raw,
                       const uint8_t *deflated, size_t deflated_size) {
    uint8_t stored[2 * RAW_MAX];
    struct image back;
    size_t size = raw_size(type);
    bool is_raw = deflated_size >= size;
    CHECK_THAT(image_write_exr(scratch, image, type, tiled, &err) == STATUS_OK, "%s", err.message);
    size_t stored_size = stored_chunk(tiled, stored, sizeof stored);
    CHECK_THAT(stored_size == (is_raw ? size : deflated_size), "deflated %zu of %zu, stored %zu", deflated_size, size,
               stored_size);
    CHECK_THAT(memcmp(stored, is_raw ? raw : deflated, stored_size) == 0, "deflated %zu of %zu", deflated_size, size);
    enum status status = image_read(scratch, &back, NULL, &err);
    CHECK_THAT(status == STATUS_OK, "%s", err.message);
    size_t wrong = 0;
    for (size_t i = 0; status == STATUS_OK && i < (size_t)PIXELS * CHANNELS; i++) {
        float wanted = image->pixel[i];
        if (type == IMAGE_HALF)
            wanted = image_float_from_half(image_half_from_float(wanted));
        wrong += back.pixel[i] != wanted;
    }
    CHECK_THAT(wrong == 0, "deflated %zu of %zu, %s: %zu values are wrong", deflated_size, size,
               tiled ? "tiled" : "lines", wrong);
    image_release(&back);
}

/* The file as libraries up to 3.4.6 write it: its last bytes are the chunk, which lies raw. The reader must find
 * out. */
static void check_old_file(const struct image *image, enum image_exr_type type, const uint8_t *deflated) {
    struct buf file;
    struct image back;
    size_t size = raw_size(type), wrong = 0;
    buf_init(&file, 1 << 20);
    CHECK(file_read(scratch, &file, &err) == STATUS_OK && file.length > size);
    memcpy(file.data + file.length - size, deflated, size);
    CHECK_THAT(image_read_memory("old", file.data, file.length, &back, NULL, &err) == STATUS_OK, "%s", err.message);
    for (size_t i = 0; back.pixel && i < (size_t)PIXELS * CHANNELS; i++)
        wrong += image_half_from_float(back.pixel[i]) != image_half_from_float(image->pixel[i]);
    CHECK_THAT(wrong == 0, "an old file: %zu values are wrong", wrong);
    file.data[file.length - 1] ^= 1; /* of the checksum: these would be pixels, then */
    image_release(&back);
    CHECK(image_read_memory("pixels", file.data, file.length, &back, NULL, &err) == STATUS_OK);
    wrong = 0;
    for (size_t i = 0; back.pixel && i < (size_t)PIXELS * CHANNELS; i++)
        wrong += image_half_from_float(back.pixel[i]) != image_half_from_float(image->pixel[i]);
    CHECK(wrong > PIXELS);
    image_release(&back);
    buf_release(&file);
}

/* Pictures whose one chunk deflates to its size less one, to just its size, and to one more. */
static void check_edge(enum image_exr_type type) {
    uint8_t raw[RAW_MAX], deflated[2 * RAW_MAX];
    struct image image;
    size_t size = raw_size(type);
    int found[3] = {0};
    image_init_rgb(&image, WIDTH, HEIGHT);
    for (uint64_t seed = 0; seed < 500 && (found[0] < 2 || found[1] < 2 || found[2] < 2); seed++) {
        for (size_t quiet = 0, length = size + 2; quiet < (size_t)PIXELS * CHANNELS && length + 1 >= size; quiet++) {
            fill(&image, seed, quiet);
            pack(&image, type, raw);
            length = deflate_chunk(raw, size, deflated, sizeof deflated);
            if (length + 1 < size || length > size + 1 || found[length + 1 - size]++ >= 2)
                continue;
            for (int tiled = 0; tiled < 2; tiled++)
                check_file(&image, type, tiled, raw, deflated, length);
            if (length == size)
                check_old_file(&image, type, deflated);
        }
    }
    CHECK_THAT(found[0] >= 2 && found[1] >= 2 && found[2] >= 2, "found %d, %d, %d", found[0], found[1], found[2]);
    image_release(&image);
}

/* A picture of more chunks than are encoded before some are written: the same bytes on any number of threads. */
static void check_threads(bool tiled) {
    struct image image;
    struct buf alone, three;
    struct parallel *pool = parallel_new(3);
    const struct image_note note = {"units", "none"};
    image_init_rgb(&image, tiled ? 1100 : 40, tiled ? 1030 : 4200);
    for (size_t i = 0; i < (size_t)image.width * image.height * CHANNELS; i++)
        image.pixel[i] = i % 7 == 0 ? rng_to_float((uint32_t)rng_key(5, i, 0)) : 0.25f;
    for (int type = IMAGE_HALF; type <= IMAGE_FLOAT; type++) {
        buf_init(&alone, SIZE_MAX);
        buf_init(&three, SIZE_MAX);
        CHECK(image_write_exr_noted(scratch, &image, (enum image_exr_type)type, tiled, &note, 1, NULL, &err) == 0);
        CHECK(file_read(scratch, &alone, &err) == STATUS_OK);
        CHECK(image_write_exr_noted(scratch, &image, (enum image_exr_type)type, tiled, &note, 1, pool, &err) == 0);
        CHECK(file_read(scratch, &three, &err) == STATUS_OK);
        CHECK(alone.length == three.length && memcmp(alone.data, three.data, alone.length) == 0);
        buf_release(&alone);
        buf_release(&three);
    }
    parallel_free(pool);
    image_release(&image);
}

int main(void) {
    int fd = mkstemp(scratch);
    close(fd);
    check_edge(IMAGE_HALF);
    check_edge(IMAGE_FLOAT);
    check_threads(false);
    check_threads(true);
    unlink(scratch);
    return check_result();
}
