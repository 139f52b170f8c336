/* test_image_tiff.c -- TIFF: pictures of six patches, made here by libtiff in its layouts, come back in their
 * colours. */
#include <tiffio.h>

#include "tests/unit/patches.h"

/* --- TIFF ---------------------------------------------------------------------------------- */

struct layout {
    uint16_t bits, format, samples, photometric, planar, compression;
    bool tiled;
};

/* Stored value of a patch in sample s: alpha is 1; inks are those of (1 - C)(1 - K) with K = 0. */
static void put_sample(const struct layout *l, uint32_t x, uint32_t y, uint16_t s, uint8_t *to) {
    float value = s < 3 ? patch[y / 16 * 3 + x / 16][s] : 1.0f;
    if (l->photometric == PHOTOMETRIC_SEPARATED)
        value = s < 3 ? 1.0f - value : 0.0f;
    if (l->photometric == PHOTOMETRIC_MINISWHITE)
        value = 1.0f - value;
    uint16_t u16 =
        l->format == SAMPLEFORMAT_IEEEFP ? image_half_from_float(4 * value) : (uint16_t)(value * 65535 + .5f);
    float f32 = 4 * value;
    double f64 = (double)f32;
    uint32_t u32 = (uint32_t)((double)value * 4294967295.0);
    uint8_t u8 = (uint8_t)(value * 255 + .5f);
    const void *from = l->bits == 8                       ? (const void *)&u8
                       : l->bits == 16                    ? (const void *)&u16
                       : l->bits == 64                    ? (const void *)&f64
                       : l->format == SAMPLEFORMAT_IEEEFP ? (const void *)&f32
                                                          : (const void *)&u32;
    memcpy(to, from, l->bits / 8);
}

static void fill_block(const struct layout *l, uint32_t x0, uint32_t y0, uint32_t width, uint32_t height,
                       uint16_t plane, uint8_t *block) {
    uint16_t count = l->planar == PLANARCONFIG_SEPARATE ? 1 : l->samples;
    for (uint32_t y = 0; y < height; y++)
        for (uint32_t x = 0; x < width; x++)
            for (uint16_t s = 0; s < count; s++)
                put_sample(l, (x0 + x) % WIDTH, (y0 + y) % HEIGHT, (uint16_t)(plane + s),
                           block + ((size_t)(y * width + x) * count + s) * (l->bits / 8));
}

static void set_fields(TIFF *tiff, const struct layout *l, const char *extra) {
    static const uint16_t alpha[1] = {EXTRASAMPLE_UNASSALPHA};
    TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, WIDTH);
    TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, HEIGHT);
    TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, l->bits);
    TIFFSetField(tiff, TIFFTAG_SAMPLEFORMAT, l->format);
    TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, l->samples);
    TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, l->photometric);
    TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, l->planar);
    TIFFSetField(tiff, TIFFTAG_COMPRESSION, l->compression);
    if (l->samples == 4 && l->photometric == PHOTOMETRIC_RGB)
        TIFFSetField(tiff, TIFFTAG_EXTRASAMPLES, 1, alpha);
    if (extra && strcmp(extra, "raw") == 0)
        TIFFSetField(tiff, TIFFTAG_DNGVERSION, "\1\4\0\0");
    if (extra && strcmp(extra, "turned") == 0)
        TIFFSetField(tiff, TIFFTAG_ORIENTATION, ORIENTATION_RIGHTTOP);
}

static void write_tiff(const struct layout *l, const char *mode, const char *extra) {
    static uint8_t block[WIDTH * HEIGHT * 4 * 8];
    uint16_t planes = l->planar == PLANARCONFIG_SEPARATE ? l->samples : 1;
    TIFF *tiff = TIFFOpen(scratch, mode);
    CHECK(tiff != NULL);
    set_fields(tiff, l, extra);
    uint32_t rows = 12; /* the last strip is shorter, the last tile reaches over the edge */
    if (l->tiled) {
        TIFFSetField(tiff, TIFFTAG_TILEWIDTH, 32);
        TIFFSetField(tiff, TIFFTAG_TILELENGTH, 16);
        for (uint16_t p = 0; p < planes; p++)
            for (uint32_t y = 0; y < HEIGHT; y += 16)
                for (uint32_t x = 0; x < WIDTH; x += 32) {
                    fill_block(l, x, y, 32, 16, p, block);
                    CHECK(TIFFWriteTile(tiff, block, x, y, 0, p) > 0);
                }
    } else {
        TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, rows);
        for (uint16_t p = 0; p < planes; p++)
            for (uint32_t y = 0; y < HEIGHT; y += rows) {
                uint32_t height = HEIGHT - y < rows ? HEIGHT - y : rows;
                fill_block(l, 0, y, WIDTH, height, p, block);
                tmsize_t size = (tmsize_t)(WIDTH * height * (l->samples / planes) * (l->bits / 8));
                CHECK(TIFFWriteEncodedStrip(tiff, TIFFComputeStrip(tiff, y, p), block, size) == size);
            }
    }
    TIFFClose(tiff);
}

static void tiff(void) {
    static const uint16_t uint = SAMPLEFORMAT_UINT, ieee = SAMPLEFORMAT_IEEEFP, rgb = PHOTOMETRIC_RGB,
                          whole = PLANARCONFIG_CONTIG, apart = PLANARCONFIG_SEPARATE;
    const struct {
        struct layout layout;
        const char *mode;
    } kinds[] = {
        {{8, uint, 3, rgb, whole, COMPRESSION_NONE, false}, "w"},
        {{8, uint, 4, rgb, apart, COMPRESSION_LZW, true}, "wb"},
        {{16, uint, 3, rgb, whole, COMPRESSION_ADOBE_DEFLATE, true}, "wb"},
        {{16, uint, 4, rgb, whole, COMPRESSION_PACKBITS, false}, "w8"},
        {{32, uint, 3, rgb, apart, COMPRESSION_NONE, false}, "wl"},
        {{16, ieee, 3, rgb, whole, COMPRESSION_NONE, false}, "wb"},
        {{32, ieee, 3, rgb, whole, COMPRESSION_ADOBE_DEFLATE, false}, "w"},
        {{64, ieee, 4, rgb, apart, COMPRESSION_LZW, true}, "w8"},
        {{8, uint, 4, PHOTOMETRIC_SEPARATED, whole, COMPRESSION_LZW, false}, "w"},
        {{16, uint, 4, PHOTOMETRIC_SEPARATED, apart, COMPRESSION_NONE, true}, "w"},
    };
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        const struct layout *l = &kinds[i].layout;
        struct image image;
        struct image_info info;
        char what[32];
        snprintf(what, sizeof what, "TIFF %zu", i);
        write_tiff(l, kinds[i].mode, NULL);
        if (!reads(scratch, &image, &info))
            continue;
        bool is_float = l->format == ieee, has_alpha = l->samples == 4 && l->photometric == rgb;
        check_patches(what, &image, is_float ? 4 : 1,
                      l->bits == 8                ? .5 / 255 + 1e-6
                      : is_float && l->bits == 16 ? 2e-3
                                                  : 1e-5);
        CHECK(info.encoding == (is_float ? IMAGE_LINEAR : IMAGE_SRGB) && info.orientation == 1);
        CHECK(!has_alpha || middle(&image, 0)[3] == (is_float ? 4.0f : 1.0f));
        CHECK(!strstr(info.color_warning, "profile") == (l->bits != 16 || is_float) || l->photometric != rgb);
        image_release(&image);
        if (i < 3)
            cut_short(scratch, 0);
    }
}

/* One page after a thumbnail; grey, inverted; few bits; turned; camera raw by its tag and by its name. */
static void tiff_others(void) {
    struct layout grey = {8, SAMPLEFORMAT_UINT, 1, PHOTOMETRIC_MINISWHITE, PLANARCONFIG_CONTIG, COMPRESSION_LZW, false};
    struct layout rgb = {8, SAMPLEFORMAT_UINT, 3, PHOTOMETRIC_RGB, PLANARCONFIG_CONTIG, COMPRESSION_LZW, false};
    struct layout odd = {16, SAMPLEFORMAT_INT, 3, PHOTOMETRIC_RGB, PLANARCONFIG_CONTIG, COMPRESSION_NONE, false};
    struct image image;
    struct image_info info;
    write_tiff(&grey, "w", "turned");
    if (reads(scratch, &image, &info)) {
        CHECK(info.orientation == 6 && image.width == WIDTH);
        CHECK_NEAR(middle(&image, 0)[2], patch[0][0], .003);
        image_release(&image);
    }
    write_tiff(&odd, "w", NULL);
    check_refused(scratch, "sample format 2");
    write_tiff(&rgb, "w", "raw");
    check_refused(scratch, "raw file");
    CHECK(strstr(err.hint, "16-bit linear"));
    char raw[80];
    snprintf(raw, sizeof raw, "%s.NEF", scratch);
    write_tiff(&rgb, "w", NULL);
    CHECK(rename(scratch, raw) == 0);
    check_refused(raw, "raw file");
    unlink(raw);
}

int main(void) {
    snprintf(scratch, sizeof scratch, "/tmp/unbake-test-formats-%d", (int)getpid());
    TIFFSetWarningHandler(NULL);
    tiff();
    tiff_others();
    unlink(scratch);
    return check_result();
}
