/* png_write.c -- writing PNG pictures by libpng, and reading back what was written. Errors arrive by longjmp: see
 * png_read.c. */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "common/image_codec.h"
#include "common/mem.h"
#include "common/png_memory.h"

/* sRGB bytes of linear values, without a power for each: `least` has the least value of each byte, found by bisection,
 * so that bytes are those of image_linear_to_srgb; `guess` has the byte of the first value of each of 64 steps to an
 * octave, from which least[] is one or two comparisons away. */
enum { STEP_BITS = 17, LOWEST = 127 - 13, STEPS = 13 << (23 - STEP_BITS) }; /* below 2^-13 all are 0 */
struct bytes_of_linear {
    float least[257];
    uint8_t guess[STEPS];
};

struct writer {
    const char *path;
    FILE *file;
    struct error *err;
    enum status status;
    png_structp png;
    png_infop png_info;
    struct bytes_of_linear bytes;
    uint8_t *row;
};

static void write_failed(png_structp png, png_const_charp message) {
    struct writer *w = png_get_error_ptr(png);
    w->status = error_set(w->err, STATUS_INTERNAL, "cannot write %s: %s", w->path, message);
    longjmp(png_jmpbuf(png), 1);
}

static void ignore_warning(png_structp png, png_const_charp message) {
    (void)png;
    (void)message;
}

static void write_bytes(png_structp png, png_bytep data, size_t length) {
    struct writer *w = png_get_io_ptr(png);
    if (fwrite(data, 1, length, w->file) == length)
        return;
    w->status = error_set_errno(w->err, errno, "cannot write %s", w->path);
    longjmp(png_jmpbuf(png), 1);
}

static void flush_bytes(png_structp png) { (void)png; /* fclose does */ }

static uint8_t to_byte_by_power(float value) { return (uint8_t)(image_linear_to_srgb(value) * 255.0f + 0.5f); }

static float float_of(uint32_t bits) {
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static void bytes_init(struct bytes_of_linear *b) {
    const uint32_t one = 127u << 23;
    for (uint32_t byte = 1; byte < 256; byte++) {
        uint32_t below = 0, above = one; /* to_byte_by_power is less than the byte, and not less */
        while (above - below > 1) {
            uint32_t middle = below + (above - below) / 2;
            if (to_byte_by_power(float_of(middle)) < byte)
                below = middle;
            else
                above = middle;
        }
        b->least[byte] = float_of(above);
    }
    b->least[0] = 0.0f;
    b->least[256] = INFINITY;
    for (uint32_t i = 0; i < STEPS; i++)
        b->guess[i] = to_byte_by_power(float_of(((uint32_t)LOWEST << 23) + (i << STEP_BITS)));
}

static uint8_t to_byte(const struct bytes_of_linear *b, float linear) {
    float value = linear > 0 ? fminf(linear, 1) : 0; /* not a number: 0 */
    uint32_t bits, byte;
    memcpy(&bits, &value, sizeof bits);
    if (bits < (uint32_t)LOWEST << 23)
        return 0;
    if (value >= 1.0f)
        return 255;
    byte = b->guess[(bits - ((uint32_t)LOWEST << 23)) >> STEP_BITS];
    while (value >= b->least[byte + 1])
        byte++;
    return (uint8_t)byte;
}

/* One row of `out_count` channels: 3, or 1 for a grey picture. */
static void fill_row(const struct bytes_of_linear *b, const struct image *image, uint32_t y, uint32_t out_count,
                     float scale, uint8_t *row) {
    const float *pixel = image->pixel + (size_t)y * image->width * image->channel_count;
    uint32_t step = image->channel_count < 3 ? 0 : 1; /* grey: all from the first channel */
    for (uint32_t x = 0; x < image->width; x++, pixel += image->channel_count, row += out_count) {
        bool finite = true;
        for (uint32_t c = 0; c < out_count; c++) {
            float value = pixel[c * step] * scale;
            finite = finite && isfinite(value);
            row[c] = to_byte(b, value);
        }
        if (!finite)
            memcpy(row, "\xff\x00\xff", out_count);
    }
}

static bool has_non_finite(const struct image *image) {
    size_t pixel_count = (size_t)image->width * image->height;
    for (size_t i = 0; i < pixel_count; i++)
        if (!isfinite(image->pixel[i * image->channel_count]))
            return true;
    return false;
}

static void write_picture(struct writer *w, const struct image *image, float scale) {
    /* A grey picture with a non-finite value is written in colour, for the magenta to show. */
    bool colour = image->channel_count >= 3 || has_non_finite(image);
    png_set_IHDR(w->png, w->png_info, image->width, image->height, 8, colour ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_GRAY,
                 PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_sRGB(w->png, w->png_info, PNG_sRGB_INTENT_PERCEPTUAL);
    png_set_compression_level(w->png, 4);
    png_write_info(w->png, w->png_info);
    w->row = mem_array(image->width, 3);
    for (uint32_t y = 0; y < image->height; y++) {
        fill_row(&w->bytes, image, y, colour ? 3 : 1, scale, w->row);
        png_write_row(w->png, w->row);
    }
    png_write_end(w->png, NULL);
}

static bool is_regular(FILE *file) {
    struct stat facts;
    return fstat(fileno(file), &facts) == 0 && S_ISREG(facts.st_mode);
}

enum status image_write_png(const char *path, const struct image *image, float scale, struct error *err) {
    struct writer w = {.path = path, .err = err};
    struct writer *volatile kept = &w;
    bytes_init(&w.bytes);
    w.file = fopen(path, "wbe");
    if (!w.file)
        return error_set_errno(err, errno, "cannot create %s", path);
    w.png = png_create_write_struct_2(PNG_LIBPNG_VER_STRING, &w, write_failed, ignore_warning, NULL, png_memory_new,
                                      png_memory_free);
    w.png_info = w.png ? png_create_info_struct(w.png) : NULL;
    if (!w.png_info)
        w.status = error_set(err, STATUS_INTERNAL, "libpng does not start");
    else if (setjmp(png_jmpbuf(w.png)) == 0) {
        png_set_write_fn(w.png, &w, write_bytes, flush_bytes);
        write_picture(&w, image, scale);
    }
    png_destroy_write_struct(&kept->png, &kept->png_info);
    mem_free(kept->row);
    bool is_file = is_regular(kept->file);
    if (fclose(kept->file) != 0 && kept->status == STATUS_OK)
        kept->status = error_set_errno(err, errno, "cannot write %s", path);
    return kept->status == STATUS_OK && is_file ? image_check_png(path, image, scale, err) : kept->status;
}

/* ---------------------------------------------------------------------------- reading back */

struct checker {
    struct image_source source;
    uint64_t offset;
    struct error *err;
    enum status status;
    png_structp png;
    png_infop png_info;
    struct bytes_of_linear bytes;
    uint8_t *found, *wanted; /* a row each */
};

static void check_failed(png_structp png, png_const_charp message) {
    struct checker *c = png_get_error_ptr(png);
    c->status = error_set(c->err, STATUS_CORRUPT, "%s: read back, it is no PNG: %s", c->source.name, message);
    longjmp(png_jmpbuf(png), 1);
}

static void read_back(png_structp png, png_bytep out, size_t length) {
    struct checker *c = png_get_io_ptr(png);
    size_t got = image_source_read(&c->source, c->offset, out, length);
    c->offset += got;
    if (got < length)
        png_error(png, "the file is cut short");
}

static void compare_rows(struct checker *c, const struct image *image, float scale) {
    png_read_info(c->png, c->png_info);
    uint32_t channel_count = png_get_channels(c->png, c->png_info);
    if (png_get_image_width(c->png, c->png_info) != image->width ||
        png_get_image_height(c->png, c->png_info) != image->height || png_get_bit_depth(c->png, c->png_info) != 8 ||
        (channel_count != 1 && channel_count != 3))
        png_error(c->png, "another size");
    size_t row_bytes = (size_t)image->width * channel_count;
    c->found = mem_alloc(row_bytes);
    c->wanted = mem_alloc(row_bytes);
    for (uint32_t y = 0; y < image->height; y++) {
        fill_row(&c->bytes, image, y, channel_count, scale, c->wanted);
        png_read_row(c->png, c->found, NULL);
        if (memcmp(c->found, c->wanted, row_bytes) == 0)
            continue;
        c->status = error_set(c->err, STATUS_CORRUPT, "%s: read back, row %u is another", c->source.name, y);
        return;
    }
    png_read_end(c->png, NULL);
}

enum status image_check_png(const char *path, const struct image *image, float scale, struct error *err) {
    struct checker c = {.err = err};
    struct checker *volatile kept = &c;
    bytes_init(&c.bytes);
    enum status status = image_source_open(&c.source, path, err);
    if (status != STATUS_OK)
        return status;
    c.png = png_create_read_struct_2(PNG_LIBPNG_VER_STRING, &c, check_failed, ignore_warning, NULL, png_memory_new,
                                     png_memory_free);
    c.png_info = c.png ? png_create_info_struct(c.png) : NULL;
    if (!c.png_info)
        c.status = error_set(err, STATUS_INTERNAL, "libpng does not start");
    else if (setjmp(png_jmpbuf(c.png)) == 0) {
        png_set_read_fn(c.png, &c, read_back);
        png_set_crc_action(c.png, PNG_CRC_ERROR_QUIT, PNG_CRC_ERROR_QUIT);
        compare_rows(&c, image, scale);
    }
    png_destroy_read_struct(&kept->png, &kept->png_info, NULL);
    mem_free(kept->found);
    mem_free(kept->wanted);
    image_source_close(&kept->source);
    if (kept->source.io_error)
        return error_set_errno(err, kept->source.io_error, "cannot read back %s", path);
    return kept->status;
}
