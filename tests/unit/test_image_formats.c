/* test_image_formats.c -- HEIF, AVIF, WebP and CMYK JPEG: pictures of six patches, made here by the libraries' encoders
 * (those of HEIF are in tests/data/image, by libheif 1.15 with x265 and aom), come back in their colours; layers of
 * EXR; what is cut short, or of a kind that is not read, is refused. */
#include <webp/encode.h>
#include <webp/mux.h>

#include "tests/unit/patches.h"

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
    webp();
    heif();
    cmyk();
    foreign();
    layers();
    unlink(scratch);
    return check_result();
}
