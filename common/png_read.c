/* png_read.c -- reads PNG pictures by libpng (libpng.org/pub/png/libpng-manual.txt).
 *
 * libpng reports errors by longjmp, so each entry point keeps its state in one struct that outlives the jump and
 * cleans up after setjmp has returned. A damaged file is refused as a whole, even if part of it decodes: checksums
 * are checked. */
#include <setjmp.h>
#include <stdio.h>
#include <string.h>

#include "common/image_codec.h"
#include "common/mem.h"
#include "common/png_color.h"
#include "common/png_memory.h"

/* Deflate's best ratio is 1032 : 1. */
#define MAX_RATIO 1032
/* Largest single allocation of libpng, for text and profiles that are ignored. */
#define MAX_CHUNK_BYTES ((png_alloc_size_t)8 << 20)

struct png_reader {
    struct image_source *source;
    uint64_t offset;
    struct image *image;
    struct image_info *info;
    bool probe;
    struct error *err;
    enum status status; /* what the jump reports */
    png_structp png;
    png_infop png_info;
    uint8_t *row; /* [row_bytes] one row as stored */
    bool is_grey;
    struct color color;
    char warning[128]; /* the last one, which often explains the error that follows */
};

static void read_failed(png_structp png, png_const_charp message) {
    struct png_reader *r = png_get_error_ptr(png);
    r->status = error_set(r->err, STATUS_INPUT, "%s: damaged PNG: %s%s%s", r->source->name, message,
                          r->warning[0] ? "; " : "", r->warning);
    longjmp(png_jmpbuf(png), 1);
}

/* Warnings alone concern chunks that do not affect pixels (profiles, times, text). */
static void note_warning(png_structp png, png_const_charp message) {
    struct png_reader *r = png_get_error_ptr(png);
    snprintf(r->warning, sizeof r->warning, "%s", message);
}

static void read_bytes(png_structp png, png_bytep out, size_t length) {
    struct png_reader *r = png_get_io_ptr(png);
    size_t got = image_source_read(r->source, r->offset, out, length);
    r->offset += got;
    if (got < length)
        png_error(png, "the file is cut short");
}

static void stop(struct png_reader *r, enum status status) {
    r->status = status;
    longjmp(png_jmpbuf(r->png), 1);
}

/* Makes libpng expand everything to 8 or 16-bit RGB or RGBA. */
static void set_transforms(struct png_reader *r, int color) {
    bool transparent = png_get_valid(r->png, r->png_info, PNG_INFO_tRNS) != 0;
    if (color == PNG_COLOR_TYPE_PALETTE)
        png_set_palette_to_rgb(r->png);
    else
        png_set_expand_gray_1_2_4_to_8(r->png);
    if (transparent)
        png_set_tRNS_to_alpha(r->png);
    if (!(color & PNG_COLOR_MASK_COLOR))
        png_set_gray_to_rgb(r->png);
}

/* libpng allocates the size that a chunk claims before reading it, up to 2 GiB regardless of its limit: a chunk must
 * not claim more than the file has. Data after IEND is not read. */
static void check_chunks(struct png_reader *r) {
    uint64_t size = r->source->size, at = 8;
    uint8_t head[8];
    while (image_source_read(r->source, at, head, sizeof head) == sizeof head) {
        uint64_t length = (uint64_t)png_get_uint_32(head);
        if (length + 12 > size - at)
            png_error(r->png, "a chunk is longer than the file");
        if (memcmp(head + 4, "IEND", 4) == 0)
            break;
        at += length + 12;
    }
}

static void read_header(struct png_reader *r) {
    check_chunks(r);
    png_read_info(r->png, r->png_info);
    png_uint_32 width, height;
    int depth, color;
    png_get_IHDR(r->png, r->png_info, &width, &height, &depth, &color, NULL, NULL, NULL);
    bool alpha = (color & PNG_COLOR_MASK_ALPHA) || png_get_valid(r->png, r->png_info, PNG_INFO_tRNS) != 0;
    enum status status = image_header(r->image, r->source->name, width, height, alpha ? 4 : 3, image_rgba, r->err);
    if (status != STATUS_OK)
        stop(r, status);
    uint64_t bytes = (uint64_t)png_get_rowbytes(r->png, r->png_info) * height;
    if (bytes / MAX_RATIO > r->source->size)
        png_error(r->png, "the file is too short for its picture's size");
    r->is_grey = !(color & PNG_COLOR_MASK_COLOR);
    r->info->encoding = IMAGE_SRGB;
    r->info->bits = depth == 16 ? 16 : 8;
    png_uint_32 exif_size = 0;
    png_bytep exif = NULL;
    if (png_get_eXIf_1(r->png, r->png_info, &exif_size, &exif) != 0)
        image_parse_exif(exif, exif_size, r->info);
    set_transforms(r, color);
}

static void convert_row(const struct png_reader *r, const uint8_t *from, float *to) {
    size_t count = (size_t)r->image->width * r->image->channel_count;
    if (r->info->bits == 8)
        for (size_t i = 0; i < count; i++)
            to[i] = (float)from[i] / 255.0f;
    else
        for (size_t i = 0; i < count; i++)
            to[i] = (float)(from[2 * i] << 8 | from[2 * i + 1]) / 65535.0f;
}

/* Rows of an interlaced picture accumulate over seven passes in the memory of their own float row, which is large
 * enough, and are converted after the last pass. */
static void read_pixels(struct png_reader *r) {
    int pass_count = png_set_interlace_handling(r->png);
    png_read_update_info(r->png, r->png_info);
    struct image *image = r->image;
    size_t row_bytes = png_get_rowbytes(r->png, r->png_info);
    size_t row_floats = (size_t)image->width * image->channel_count;
    if (row_bytes != row_floats * (r->info->bits == 16 ? 2 : 1))
        png_error(r->png, "unexpected row size");
    image_allocate(image);
    r->row = mem_alloc(row_bytes);
    for (int pass = 0; pass < pass_count; pass++)
        for (uint32_t y = 0; y < image->height; y++) {
            float *floats = image->pixel + y * row_floats;
            uint8_t *gathered = pass_count == 1 ? r->row : (uint8_t *)floats;
            png_read_row(r->png, gathered, NULL);
            if (pass < pass_count - 1)
                continue;
            if (pass_count > 1)
                memcpy(r->row, gathered, row_bytes);
            convert_row(r, r->row, floats);
        }
    png_read_end(r->png, NULL);
}

static void convert(struct png_reader *r) {
    if (!png_color_read(r->source, r->is_grey, r->info->bits, &r->color))
        image_color_by_exif(r->info, &r->color);
    image_convert(r->image, r->info, &r->color);
}

enum status image_read_png(struct image_source *source, bool probe, struct image *image, struct image_info *info,
                           struct error *err) {
    struct png_reader r = {.source = source, .image = image, .info = info, .probe = probe, .err = err};
    struct png_reader *volatile kept = &r;
    r.png = png_create_read_struct_2(PNG_LIBPNG_VER_STRING, &r, read_failed, note_warning, NULL, png_memory_new,
                                     png_memory_free);
    r.png_info = r.png ? png_create_info_struct(r.png) : NULL;
    if (!r.png_info) {
        png_destroy_read_struct(&r.png, NULL, NULL);
        return error_set(err, STATUS_INTERNAL, "libpng does not start");
    }
    if (setjmp(png_jmpbuf(r.png)) == 0) {
        png_set_read_fn(r.png, &r, read_bytes);
        png_set_user_limits(r.png, IMAGE_MAX_SIDE, IMAGE_MAX_SIDE);
        png_set_chunk_malloc_max(r.png, MAX_CHUNK_BYTES);
        png_set_keep_unknown_chunks(r.png, PNG_HANDLE_CHUNK_NEVER, (png_const_bytep) "cHRM\0gAMA\0iCCP\0sRGB\0cICP", 5);
        png_set_crc_action(r.png, PNG_CRC_ERROR_QUIT, PNG_CRC_WARN_DISCARD);
        read_header(&r);
        if (!probe)
            read_pixels(&r);
        if (!probe && !source->as_stored)
            convert(&r);
    }
    png_destroy_read_struct(&kept->png, &kept->png_info, NULL);
    mem_free(kept->row);
    return kept->status;
}

const char *image_png_version(void) { return png_get_libpng_ver(NULL); }
