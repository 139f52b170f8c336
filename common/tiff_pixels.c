/* tiff_pixels.c -- see tiff.h.
 *
 * Strips and tiles are blocks of the picture, in which either the samples of a pixel follow each other or, in separate
 * planes, a block holds one sample of each. */
#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "common/tiff.h"

enum status tiff_refuse(const struct tiff_reader *r, const char *why, struct error *err) {
    if (r->compression != 0 && !TIFFIsCODECConfigured(r->compression)) {
        error_set(err, STATUS_INPUT, "%s: this TIFF's compression (%d) is not known to this system's libtiff",
                  r->source->name, r->compression);
        return error_hint(err, "save it uncompressed or with ZIP compression");
    }
    return error_set(err, STATUS_INPUT, "%s: damaged TIFF: %s", r->source->name, r->complaint[0] ? r->complaint : why);
}

/* Places of a strip or tile. */
struct layout {
    bool is_tiled;
    uint32_t block_width, block_height;
    size_t block_bytes;
    uint16_t block_samples; /* of a pixel in one block */
    uint16_t plane_count;
};

static enum status find_layout(const struct tiff_reader *r, struct layout *l, struct error *err) {
    *l = (struct layout){.is_tiled = TIFFIsTiled(r->tiff) != 0, .block_width = r->width, .block_height = r->height};
    bool is_separate = r->planar == PLANARCONFIG_SEPARATE;
    l->plane_count = is_separate ? r->sample_count : 1;
    l->block_samples = is_separate ? 1 : r->sample_count;
    if (l->is_tiled) {
        TIFFGetField(r->tiff, TIFFTAG_TILEWIDTH, &l->block_width);
        TIFFGetField(r->tiff, TIFFTAG_TILELENGTH, &l->block_height);
    } else {
        TIFFGetFieldDefaulted(r->tiff, TIFFTAG_ROWSPERSTRIP, &l->block_height);
        if (l->block_height > r->height)
            l->block_height = r->height;
    }
    uint64_t pixels = (uint64_t)l->block_width * l->block_height;
    uint64_t bytes = l->is_tiled ? TIFFTileSize64(r->tiff) : TIFFStripSize64(r->tiff);
    if (pixels == 0 || pixels > IMAGE_MAX_PIXELS || bytes != pixels * l->block_samples * (r->bits / 8))
        return tiff_refuse(r, "its strips or tiles have an impossible size", err);
    l->block_bytes = (size_t)bytes;
    return STATUS_OK;
}

/* Sample `i` of a block, in the processor's byte order. */
static float sample_at(const struct tiff_reader *r, const uint8_t *block, size_t i) {
    bool is_float = r->format == SAMPLEFORMAT_IEEEFP;
    uint16_t u16;
    uint32_t u32;
    float f32;
    double f64;
    switch (r->bits) {
    case 8: return (float)block[i] / 255.0f;
    case 16:
        memcpy(&u16, block + 2 * i, sizeof u16);
        return is_float ? image_float_from_half(u16) : (float)u16 / 65535.0f;
    case 32:
        memcpy(&u32, block + 4 * i, sizeof u32);
        memcpy(&f32, block + 4 * i, sizeof f32);
        return is_float ? f32 : (float)((double)u32 / 4294967295.0);
    default: memcpy(&f64, block + 8 * i, sizeof f64); return (float)f64;
    }
}

/* Which channel of the picture a sample goes to; -1: none. */
static int channel_of(const struct tiff_reader *r, uint32_t sample) {
    if (sample < (uint32_t)r->color)
        return (int)sample;
    return r->has_alpha && sample == (uint32_t)r->color ? 3 : -1;
}

static void put_block(const struct tiff_reader *r, const struct layout *l, const uint8_t *block, uint32_t x0,
                      uint32_t y0, uint32_t plane, struct image *image) {
    uint32_t width = r->width - x0 < l->block_width ? r->width - x0 : l->block_width;
    uint32_t height = r->height - y0 < l->block_height ? r->height - y0 : l->block_height;
    for (uint32_t s = 0; s < l->block_samples; s++) {
        int channel = channel_of(r, l->plane_count > 1 ? plane : s);
        for (uint32_t y = 0; y < height && channel >= 0; y++) {
            float *to = image->pixel + ((size_t)(y0 + y) * r->width + x0) * image->channel_count + (size_t)channel;
            size_t from = (size_t)y * l->block_width * l->block_samples + s;
            for (uint32_t x = 0; x < width; x++)
                to[(size_t)x * image->channel_count] = sample_at(r, block, from + (size_t)x * l->block_samples);
        }
    }
}

static bool read_block(const struct tiff_reader *r, const struct layout *l, uint8_t *block, uint32_t x0, uint32_t y0,
                       uint16_t plane) {
    tmsize_t got, wanted = (tmsize_t)l->block_bytes;
    if (l->is_tiled) {
        got = TIFFReadEncodedTile(r->tiff, TIFFComputeTile(r->tiff, x0, y0, 0, plane), block, wanted);
    } else {
        if (r->height - y0 < l->block_height) /* the last strip is shorter */
            wanted = (tmsize_t)(l->block_bytes / l->block_height * (r->height - y0));
        got = TIFFReadEncodedStrip(r->tiff, TIFFComputeStrip(r->tiff, y0, plane), block, wanted);
    }
    return got == wanted && r->complaint[0] == '\0';
}

static enum status read_blocks(struct tiff_reader *r, struct image *image, struct error *err) {
    struct layout l;
    enum status status = find_layout(r, &l, err);
    if (status != STATUS_OK)
        return status;
    uint8_t *block = mem_alloc(l.block_bytes);
    image_allocate(image);
    for (uint16_t plane = 0; plane < l.plane_count && status == STATUS_OK; plane++)
        for (uint32_t y = 0; y < r->height && status == STATUS_OK; y += l.block_height)
            for (uint32_t x = 0; x < r->width && status == STATUS_OK; x += l.block_width) {
                if (read_block(r, &l, block, x, y, plane))
                    put_block(r, &l, block, x, y, plane, image);
                else
                    status = tiff_refuse(r, "the file is cut short", err);
            }
    mem_free(block);
    return status;
}

static void finish_grey(const struct tiff_reader *r, struct image *image) {
    size_t count = (size_t)r->width * r->height;
    bool is_inverted = r->photometric == PHOTOMETRIC_MINISWHITE;
    for (size_t i = 0; i < count; i++) {
        float *pixel = image->pixel + i * image->channel_count;
        pixel[1] = pixel[2] = pixel[0] = is_inverted ? 1.0f - pixel[0] : pixel[0];
    }
}

/* Palettes, few bits, subsampled YCbCr and such, in 8 bits, by the library. */
static enum status read_converted(struct tiff_reader *r, struct image *image, struct error *err) {
    TIFFRGBAImage converter;
    size_t count = (size_t)r->width * r->height;
    char why[1024] = "";
    if (!TIFFRGBAImageOK(r->tiff, why) || !TIFFRGBAImageBegin(&converter, r->tiff, 1, why))
        return tiff_refuse(r, why, err);
    converter.req_orientation = converter.orientation; /* rows as stored */
    uint32_t *raster = mem_calloc(count, sizeof *raster);
    bool ok = TIFFRGBAImageGet(&converter, raster, r->width, r->height) != 0 && r->complaint[0] == '\0';
    TIFFRGBAImageEnd(&converter);
    if (ok)
        image_allocate(image);
    for (size_t i = 0; i < count && ok; i++) {
        const float stored[4] = {(float)TIFFGetR(raster[i]) / 255.0f, (float)TIFFGetG(raster[i]) / 255.0f,
                                 (float)TIFFGetB(raster[i]) / 255.0f, (float)TIFFGetA(raster[i]) / 255.0f};
        memcpy(image->pixel + i * image->channel_count, stored, image->channel_count * sizeof *stored);
    }
    mem_free(raster);
    return ok ? STATUS_OK : tiff_refuse(r, "its pixels cannot be decoded", err);
}

enum status tiff_read_pixels(struct tiff_reader *r, struct image *image, struct error *err) {
    r->is_decoding = true;
    r->complaint[0] = '\0';
    enum status status = r->is_simple ? read_blocks(r, image, err) : read_converted(r, image, err);
    r->is_decoding = false;
    if (status != STATUS_OK || !r->is_simple)
        return status;
    if (r->color == TIFF_GREY)
        finish_grey(r, image);
    if (r->has_alpha && r->is_premultiplied)
        image_divide_by_alpha(image, INFINITY);
    return STATUS_OK;
}
