/* test_image_formats.c -- TIFF, HEIC, AVIF, WebP and CMYK JPEG: pictures of six patches, made here by the libraries'
 * encoders (those of HEIF are in tests/data/image, by libheif 1.15 with x265 and aom), come back in their colours;
 * layers of EXR; what is cut short, or of a kind that is not read, is refused. */
#include <tiffio.h>
#include <webp/encode.h>
#include <webp/mux.h>

#include "common/image.h"
#include "tests/unit/profiles.h"

#define WIDTH 48
#define HEIGHT 32 /* patches of 16 x 16 */

static const float patch[6][3] = {{.8f, .2f, .2f}, {.2f, .7f, .3f}, {.2f, .3f, .8f},
                                  {.5f, .5f, .5f}, {1, 1, 1},       {.1f, .1f, .1f}};
static struct error err;
static char scratch[64];

static bool reads(const char *path, struct image *image, struct image_info *info) {
    enum status status = image_read(path, image, info, &err);
    CHECK_THAT(status == STATUS_OK, "%s", err.message);
    return status == STATUS_OK;
}

static const float *middle(const struct image *image, int i) {
    return image->pixel + ((size_t)(i / 3 * 16 + 8) * image->width + (size_t)(i % 3 * 16 + 8)) * image->channel_count;
}

/* Every patch holds its colour to `tolerance`, times `scale`. */
static void check_patches(const char *what, const struct image *image, double scale, double tolerance) {
    CHECK_THAT(image->width == WIDTH && image->height == HEIGHT, "%s: %u x %u", what, image->width, image->height);
    for (int i = 0; i < 6 && image->width == WIDTH; i++)
        for (int c = 0; c < 3; c++) {
            double found = (double)middle(image, i)[c], wanted = scale * (double)patch[i][c];
            CHECK_THAT(fabs(found - wanted) <= tolerance, "%s: patch %d, channel %d: %g, wanted %g", what, i, c, found,
                       wanted);
        }
}

static void check_refused(const char *path, const char *part) {
    struct image image;
    enum status status = image_read(path, &image, NULL, &err);
    CHECK_THAT(status == STATUS_INPUT && strstr(err.message, part), "%s: %s", path, status ? err.message : "is read");
    image_release(&image);
}

/* No beginning of the file is a picture. `tail`: last bytes that hold no pixels. */
static void cut_short(const char *path, size_t tail) {
    static unsigned char bytes[1 << 20];
    FILE *file = fopen(path, "rb");
    size_t size = file ? fread(bytes, 1, sizeof bytes, file) : 0;
    if (file)
        fclose(file);
    CHECK_THAT(size > 20 && size < sizeof bytes, "%s", path);
    for (size_t cut = 0; cut + tail < size; cut += 1 + size / 100) {
        struct image image;
        enum status status = image_read_memory("cut", bytes, cut, &image, NULL, &err);
        CHECK_THAT(status == STATUS_INPUT, "%s cut to %zu of %zu bytes", path, cut, size);
        image_release(&image);
    }
}

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

/* --- WebP ---------------------------------------------------------------------------------- */

static void write_file(const void *data, size_t size) {
    FILE *file = fopen(scratch, "wb");
    CHECK(file && fwrite(data, 1, size, file) == size);
    if (file)
        fclose(file);
}

/* With a profile of Display P3, if `profile`. */
static void write_webp(bool lossless, bool profile) {
    static uint8_t pixels[WIDTH * HEIGHT * 4];
    static const double p3[6] = {0.680, 0.320, 0.265, 0.690, 0.150, 0.060};
    uint8_t *out = NULL;
    for (size_t i = 0; i < WIDTH * HEIGHT; i++)
        for (size_t c = 0; c < 4; c++)
            pixels[4 * i + c] = (uint8_t)(c == 3 ? 255 * (i % WIDTH >= 16)
                                                 : lroundf(255 * patch[i / WIDTH / 16 * 3 + i % WIDTH / 16][c]));
    WebPConfig config;
    WebPPicture picture;
    WebPMemoryWriter writer;
    CHECK(WebPConfigInit(&config) && WebPPictureInit(&picture));
    config.lossless = lossless;
    config.exact = 1; /* colours where nothing is seen */
    config.quality = 95;
    picture.width = WIDTH;
    picture.height = HEIGHT;
    picture.use_argb = lossless;
    CHECK(WebPPictureImportRGBA(&picture, pixels, WIDTH * 4));
    WebPMemoryWriterInit(&writer);
    picture.writer = WebPMemoryWrite;
    picture.custom_ptr = &writer;
    CHECK(WebPEncode(&config, &picture));
    out = writer.mem;
    WebPPictureFree(&picture);
    if (profile) {
        struct buf icc;
        profile_save(profile_rgb(p3, 0, "a space"), &icc);
        WebPData bitstream = {out, writer.size}, chunk = {(const uint8_t *)icc.data, icc.length}, assembled;
        WebPMux *mux = WebPMuxCreate(&bitstream, 0);
        CHECK(WebPMuxSetChunk(mux, "ICCP", &chunk, 1) == WEBP_MUX_OK);
        CHECK(WebPMuxAssemble(mux, &assembled) == WEBP_MUX_OK);
        write_file(assembled.bytes, assembled.size);
        WebPDataClear(&assembled);
        WebPMuxDelete(mux);
        buf_release(&icc);
    } else {
        write_file(out, writer.size);
    }
    WebPMemoryWriterClear(&writer);
}

static void webp(void) {
    struct image image;
    struct image_info info;
    for (int lossless = 0; lossless < 2; lossless++) {
        write_webp(lossless, false);
        if (reads(scratch, &image, &info)) {
            check_patches("WebP", &image, 1, lossless ? .5 / 255 + 1e-6 : .02);
            CHECK(image.channel_count == 4 && middle(&image, 0)[3] == 0 && middle(&image, 1)[3] == 1);
            CHECK(info.encoding == IMAGE_SRGB && info.bits == 8);
            image_release(&image);
        }
        cut_short(scratch, 0);
    }
    write_webp(true, true);
    if (reads(scratch, &image, &info)) {
        CHECK(info.encoding == IMAGE_CONVERTED && strcmp(info.color_space, "a space") == 0);
        CHECK_NEAR(middle(&image, 3)[1], image_srgb_to_linear(128.0f / 255), 1e-3);
        CHECK(middle(&image, 0)[0] > image_srgb_to_linear(.8f) && middle(&image, 0)[1] < 0.03f);
        image_release(&image);
    }
}

/* --- HEIF ---------------------------------------------------------------------------------- */

/* Of PQ: 1 is 10000 cd/m2 and 0.5 is 92.2457 by the formula of ST 2084; diffuse white is 203. */
static void heif(void) {
    struct image image;
    struct image_info info;
    if (reads("tests/data/image/blocks.avif", &image, &info)) {
        check_patches("AVIF", &image, 1, .008);
        CHECK(info.encoding == IMAGE_SRGB && info.bits == 8 && image.channel_count == 3);
        image_release(&image);
    }
    if (reads("tests/data/image/alpha.avif", &image, &info)) {
        check_patches("AVIF with alpha", &image, 1, .008);
        CHECK(image.channel_count == 4 && middle(&image, 0)[3] == 0 && middle(&image, 5)[3] == 1);
        image_release(&image);
    }
    if (reads("tests/data/image/pq.heic", &image, &info)) {
        CHECK(info.encoding == IMAGE_CONVERTED && info.bits == 16 && strcmp(info.color_space, "Rec. 2020, PQ") == 0);
        CHECK_NEAR(middle(&image, 4)[0], 10000.0 / 203, .02);
        CHECK_NEAR(middle(&image, 3)[1], 92.2457 / 203, .01);
        image_release(&image);
    }
    /* 64 x 96 as shown, of patches twice as large: rotated by the file, whose EXIF says so a second time; Display
     * P3. */
    if (reads("tests/data/image/turned.heic", &image, &info)) {
        const float *grey = image.pixel + (16 * 64 + 16) * 3, *red = image.pixel + (16 * 64 + 48) * 3;
        CHECK(image.width == 64 && image.height == 96 && info.orientation == 1);
        CHECK(info.iso == 400 && fabs(info.exposure_time_sec - .02) < 1e-9 && fabs(info.f_number - 1.8) < 1e-9);
        CHECK(info.encoding == IMAGE_CONVERTED && info.color_space[0]);
        CHECK_NEAR(grey[0], image_srgb_to_linear(.502f), .005);
        CHECK(red[0] > image_srgb_to_linear(.8f) && red[1] < 0.03f);
        image_release(&image);
    }
    check_refused("tests/fuzz/seeds/heif/found-image-derived-from-itself", "derived from itself");
    cut_short("tests/data/image/blocks.avif", 0);
    cut_short("tests/data/image/turned.heic", 0);
}

/* --- others -------------------------------------------------------------------------------- */

static void cmyk(void) {
    struct image image;
    struct image_info info;
    if (reads("tests/data/image/cmyk.jpg", &image, &info)) {
        CHECK(info.encoding == IMAGE_SRGB && strstr(info.color_warning, "CMYK"));
        image_release(&image);
    }
}

static void foreign(void) {
    static const struct {
        char start[16];
        const char *part;
    } kinds[] = {
        {"II*\0\x10\0\0\0CR\2", "raw"},
        {"\0\0\0\x18"
         "ftypcrx ",
         "raw"},
        {"FUJIFILMCCD-RAW", "raw"},
        {"\xff\x0a", "JPEG XL"},
        {"BM", "BMP"},
        {"8BPS", "Photoshop"},
        {"hello", "not a picture"},
    };
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        write_file(kinds[i].start, sizeof kinds[i].start);
        check_refused(scratch, kinds[i].part);
    }
}

/* --- layers of EXR ------------------------------------------------------------------------- */

/* Reads an EXR of channels with these names, in which the channel at place i holds i + 1. */
static enum status read_channels(const char *const *name, uint32_t count, struct image *image) {
    struct image written;
    image_init(&written, 4, 2, count, name);
    for (uint32_t i = 0; i < 8 * count; i++)
        written.pixel[i] = (float)(i % count + 1);
    CHECK(image_write_exr(scratch, &written, IMAGE_FLOAT, false, &err) == STATUS_OK);
    image_release(&written);
    return image_read_photograph(scratch, image, NULL, &err);
}

static void layers(void) {
    static const struct {
        const char *name[8];
        float wanted[4]; /* R, G, B, A (0: none); all 0: refused */
    } kinds[] = {
        {{"b", "g", "r"}, {3, 2, 1}},
        {{"B", "G", "R", "a.B", "a.G", "a.R"}, {3, 2, 1}},
        {{"ViewLayer.Combined.A", "ViewLayer.Combined.B", "ViewLayer.Combined.G", "ViewLayer.Combined.R",
          "ViewLayer.DiffCol.B", "ViewLayer.DiffCol.G", "ViewLayer.DiffCol.R", "ViewLayer.Depth.Z"},
         {4, 3, 2, 1}},
        {{"Composite.Combined.B", "Composite.Combined.G", "Composite.Combined.R", "V.Combined.B", "V.Combined.G",
          "V.Combined.R"},
         {3, 2, 1}},
        {{"x.red", "x.green", "x.blue"}, {1, 2, 3}},
        {{"Y", "id"}, {1, 1, 1}},
        {{"a.B", "a.G", "a.R", "b.B", "b.G", "b.R"}, {0}},
        {{"X", "Z"}, {0}},
    };
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++) {
        struct image image;
        uint32_t count = 0;
        while (count < 8 && kinds[k].name[count])
            count++;
        enum status status = read_channels(kinds[k].name, count, &image);
        const float *wanted = kinds[k].wanted;
        CHECK_THAT((status == STATUS_OK) == (wanted[0] > 0), "layers %zu: %s", k, status ? err.message : "is read");
        uint32_t channel_count = wanted[3] > 0 ? 4 : 3;
        CHECK(status != STATUS_OK || (image.channel_count == channel_count && image_channel(&image, "B") == 2));
        for (uint32_t c = 0; c < channel_count && status == STATUS_OK; c++)
            CHECK_THAT(image.pixel[c] == wanted[c], "layers %zu: channel %u is %g", k, c, (double)image.pixel[c]);
        image_release(&image);
    }
    CHECK(strstr(err.message, "no channels R, G and B"));
}

int main(void) {
    snprintf(scratch, sizeof scratch, "/tmp/unbake-test-formats-%d", (int)getpid());
    TIFFSetWarningHandler(NULL);
    tiff();
    tiff_others();
    webp();
    heif();
    cmyk();
    foreign();
    layers();
    unlink(scratch);
    return check_result();
}
