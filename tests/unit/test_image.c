/* test_image.c -- what the readers make of a picture: values that other programs read from the same files (ImageMagick
 * 6.9, Pillow 12), round trips through our writers, limits and the sentences of refusals. test_image_exr.c has EXR. */
#include <dirent.h>
#include <stdint.h>
#include <sys/stat.h>

#include "common/rng.h"
#include "tests/unit/image_rig.h"

static void write_file(const void *data, size_t size) {
    FILE *file = fopen(scratch, "wb");
    CHECK(file && fwrite(data, 1, size, file) == size);
    if (file)
        fclose(file);
}

/* ------------------------------------------------------------------------------- values */

static void halves(void) {
    for (uint32_t bits = 0; bits < 65536; bits++) {
        float value = image_float_from_half((uint16_t)bits);
        uint32_t exponent = bits >> 10 & 31, mantissa = bits & 0x3ff;
        double wanted = exponent ? ldexp(1024 + mantissa, (int)exponent - 25) : ldexp(mantissa, -24);
        if (exponent == 31)
            CHECK(mantissa ? isnan(value) : isinf(value));
        else
            CHECK(fabs((double)value) == wanted);
        CHECK(!signbit(value) == !(bits & 0x8000));
        uint16_t back = image_half_from_float(value);
        CHECK(exponent == 31 && mantissa ? (back & 0x7fff) > 0x7c00 : back == bits);
    }
    /* Half-way between neighbours the even one wins; a little more and the upper one does. */
    for (uint32_t bits = 0; bits < 0x7bff; bits++) {
        float low = image_float_from_half((uint16_t)bits);
        float high = image_float_from_half((uint16_t)(bits + 1)), middle = (low + high) / 2;
        CHECK(image_half_from_float(middle) == bits + (bits & 1));
        CHECK(image_half_from_float(nextafterf(middle, 1e9f)) == bits + 1);
        CHECK(image_half_from_float(nextafterf(middle, 0)) == bits);
    }
    CHECK(image_half_from_float(65519.99f) == 0x7bff);
    CHECK(image_half_from_float(65520.0f) == 0x7c00);
    CHECK(image_half_from_float(-1e30f) == 0xfc00);
}

static void srgb(void) {
    CHECK_NEAR(image_srgb_to_linear(0.5f), 0.21404114048, 1e-7);
    CHECK_NEAR(image_srgb_to_linear(0.02f), 0.02 / 12.92, 1e-9);
    CHECK_NEAR(image_linear_to_srgb(0.18f), 0.46135612950, 1e-7);
    for (int i = 0; i <= 255; i++) {
        float value = (float)i / 255.0f;
        CHECK_NEAR(image_linear_to_srgb(image_srgb_to_linear(value)), value, 1e-6);
    }
}

/* ------------------------------------------------------------------------- PNG and JPEG */

/* Bytes of a PNG are those of the sRGB function, beside each step from a byte to the next and between. */
static void png_bytes(void) {
    enum { BESIDE = 64 };
    struct image image, back;
    size_t wrong = 0;
    image_init_rgb(&image, 2 * BESIDE, 256);
    for (uint32_t byte = 0; byte < 256; byte++) {
        float step = image_srgb_to_linear(((float)byte + 0.5f) / 255.0f), up = step, down = step;
        for (uint32_t i = 0; i < BESIDE; i++) {
            float *pixel = image.pixel + ((size_t)byte * image.width + 2 * i) * 3;
            pixel[0] = up = nextafterf(up, INFINITY);
            pixel[1] = down = nextafterf(down, 0.0f);
            for (uint64_t k = 2; k < 6; k++)
                pixel[k] = 1.1f * powf(rng_to_float((uint32_t)rng_key(byte, i, k)), 2.4f);
        }
    }
    CHECK(image_write_png(scratch, &image, 1.0f, &err) == STATUS_OK);
    CHECK(image_read_stored(scratch, &back, &err) == STATUS_OK);
    for (size_t i = 0; i < (size_t)image.width * image.height * 3; i++) {
        float value = fminf(image.pixel[i], 1.0f);
        wrong += back.pixel[i] * 255.0f != floorf(image_linear_to_srgb(value) * 255.0f + 0.5f);
    }
    CHECK_THAT(wrong == 0, "%zu", wrong);
    image_release(&back);
    image_release(&image);
}

static void png_round_trip(void) {
    struct image image, back;
    struct image_info info;
    image_init_rgb(&image, 256, 3);
    for (uint32_t x = 0; x < 256; x++)
        for (uint32_t y = 0; y < 3; y++)
            for (uint32_t c = 0; c < 3; c++)
                image.pixel[(y * 256 + x) * 3 + c] = image_srgb_to_linear((float)x / 255) / 4;
    image.pixel[1] = NAN;
    image.pixel[5] = 7;
    image.pixel[6] = -7;
    CHECK(image_write_png(scratch, &image, 4, &err) == STATUS_OK);
    if (reads(scratch, &back, &info)) {
        CHECK(back.channel_count == 3 && info.encoding == IMAGE_SRGB && info.bits == 8);
        for (uint32_t x = 3; x < 256; x++)
            CHECK(at(&back, x, 0, 1) == (float)x / 255.0f && at(&back, x, 2, 2) == (float)x / 255);
        CHECK(at(&back, 0, 0, 0) == 1 && at(&back, 0, 0, 1) == 0 && at(&back, 0, 0, 2) == 1);
        CHECK(at(&back, 1, 0, 2) == 1 && at(&back, 2, 0, 0) == 0);
        image_release(&back);
    }
    image_release(&image);

    static const char *const grey[] = {"roughness"};
    image_init(&image, 2, 2, 1, grey);
    image.pixel[0] = image_srgb_to_linear(0.6f);
    for (int k = 0; k < 2; k++) {
        CHECK(image_write_png(scratch, &image, 1, &err) == STATUS_OK);
        if (reads(scratch, &back, NULL)) {
            CHECK(at(&back, 0, 0, 0) == 0.6f && at(&back, 0, 0, 2) == 0.6f);
            CHECK(at(&back, 1, 1, 0) == (float)k && at(&back, 1, 1, 1) == 0);
            image_release(&back);
        }
        image.pixel[3] = INFINITY; /* now it takes colour */
    }
    image_release(&image);
}

static const float pixel_tolerance = 1e-6f;

static void check_pixel(const struct image *image, uint32_t x, uint32_t y, double r, double g, double b) {
    CHECK_NEAR(at(image, x, y, 0), r / 255, pixel_tolerance);
    CHECK_NEAR(at(image, x, y, 1), g / 255, pixel_tolerance);
    CHECK_NEAR(at(image, x, y, 2), b / 255, pixel_tolerance);
}

static void jpeg(void) {
    struct image image;
    struct image_info info;
    if (reads("tests/data/image/exif_little.jpg", &image, &info)) {
        CHECK(image.width == 24 && image.height == 16 && image.channel_count == 3);
        CHECK(info.encoding == IMAGE_SRGB && info.bits == 8 && info.orientation == 6);
        CHECK_NEAR(info.exposure_time_sec, 1.0 / 1666, 1e-12);
        CHECK(info.iso == 400 && info.f_number == 2.8);
        check_pixel(&image, 0, 0, 0, 2, 121);
        check_pixel(&image, 13, 7, 130, 105, 127);
        check_pixel(&image, 23, 15, 230, 222, 137);
        image_release(&image);
    }
    if (reads("tests/data/image/exif_big.jpg", &image, &info)) {
        CHECK(info.iso == 102400 && info.f_number == 2.8 && info.orientation == 6);
        check_pixel(&image, 23, 15, 230, 224, 128);
        image_release(&image);
    }
    if (reads("tests/data/image/progressive.jpg", &image, &info)) {
        CHECK(info.iso == 0 && info.orientation == 1);
        check_pixel(&image, 13, 7, 130, 105, 127);
        image_release(&image);
    }
    if (reads("tests/data/image/grey.jpg", &image, NULL)) {
        check_pixel(&image, 13, 7, 115, 115, 115);
        image_release(&image);
    }
    if (reads("tests/data/image/exif.png", &image, &info)) {
        CHECK(info.iso == 200 && info.orientation == 6);
        check_pixel(&image, 23, 15, 230, 225, 128);
        image_release(&image);
    }
}

/* A file cut anywhere must be refused: a half-decoded photograph would be taken for light. */
static void cut_short(const char *path) {
    static unsigned char bytes[1 << 16];
    FILE *file = fopen(path, "rb");
    size_t size = file ? fread(bytes, 1, sizeof bytes, file) : 0;
    if (file)
        fclose(file);
    CHECK_THAT(size > 100 && size < sizeof bytes, "%s", path);
    /* The last bytes of a JPEG or PNG only say that it ends. */
    for (size_t cut = 0; cut + 2 < size; cut += 1 + size / 500) {
        struct image image;
        enum status status = image_read_memory("cut", bytes, cut, &image, NULL, &err);
        CHECK_THAT(status == STATUS_INPUT, "%s cut to %zu bytes", path, cut);
        image_release(&image);
    }
}

/* ------------------------------------------------------------------------ Radiance, misc */

static void radiance(void) {
    static const char runs[] = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2\n\n-Y 2 +X 8\n"
                               "\2\2\0\10\210\200\10\0\10\20\30\40\50\60\70\210\0\210\201"
                               "\2\2\0\10\210\1\210\2\210\3\210\0";
    static const char flat[] = "#?RGBE\n\n-Y 1 +X 6\n\200\100\40\201\1\1\1\3\10\0\0\200\4\0\0\200";
    struct image image;
    write_file(runs, sizeof runs - 1);
    if (reads(scratch, &image, NULL)) {
        CHECK(image.width == 8 && image.height == 2 && image.channel_count == 3);
        CHECK(at(&image, 0, 0, 0) == 0.5f && at(&image, 7, 0, 1) == 56.0f / 256);
        CHECK(at(&image, 3, 0, 2) == 0 && at(&image, 3, 1, 0) == 0);
        image_release(&image);
    }
    write_file(flat, sizeof flat - 1);
    if (reads(scratch, &image, NULL)) {
        CHECK(at(&image, 0, 0, 0) == 1 && at(&image, 3, 0, 0) == 1 && at(&image, 3, 0, 2) == 0.25f);
        CHECK(at(&image, 4, 0, 0) == 8.0f / 256 && at(&image, 5, 0, 0) == 4.0f / 256);
        image_release(&image);
    }
    write_file(flat, sizeof flat - 2);
    check_refused(scratch, "row 0");
    static const char other[] = "#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\nabcd";
    write_file(other, sizeof other - 1);
    check_refused(scratch, "xyze");
    static const char turned[] = "#?RADIANCE\n\n+X 1 -Y 1\nabcd";
    write_file(turned, sizeof turned - 1);
    check_refused(scratch, "+X 1 -Y 1");
}

static void probing(void) {
    static const char *const files[] = {"exif_little.jpg", "exif.png", "zip.exr", "parts.exr"};
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++) {
        char path[64];
        snprintf(path, sizeof path, "tests/data/image/%s", files[i]);
        struct image whole, header;
        struct image_info whole_info, header_info;
        if (!reads(path, &whole, &whole_info))
            continue;
        CHECK(image_probe(path, &header, &header_info, &err) == STATUS_OK);
        CHECK(header.pixel == NULL && header.width == whole.width);
        CHECK(header.height == whole.height && header.channel_count == whole.channel_count);
        CHECK(memcmp(header.channel, whole.channel, sizeof *whole.channel * whole.channel_count) == 0);
        CHECK(header_info.iso == whole_info.iso && header_info.bits == whole_info.bits);
        image_release(&whole);
        image_release(&header);
    }
}

static void other_files(void) {
    struct image image;
    CHECK(image_read("/nonexistent.png", &image, NULL, &err) == STATUS_NOT_FOUND);
    image_release(&image);
    write_file("", 0);
    check_refused(scratch, "empty");
    write_file("no picture....", 14);
    check_refused(scratch, "not a picture");
    check_refused("/tmp", "regular");
    unlink(scratch);
    CHECK(mkfifo(scratch, 0600) == 0);
    check_refused(scratch, "regular"); /* and does not wait for a writer */
    unlink(scratch);
}

int main(void) {
    snprintf(scratch, sizeof scratch, "/tmp/unbake-image-%d", (int)getpid());
    halves();
    srgb();
    for (uint32_t channel_count = 1; channel_count <= 5; channel_count++)
        for (int kind = 0; kind < 4; kind++)
            png_bytes();
    png_round_trip();
    jpeg();
    cut_short("tests/data/image/exif_little.jpg");
    cut_short("tests/data/image/progressive.jpg");
    cut_short("tests/data/image/exif.png");
    cut_short("tests/data/image/zip.exr");
    cut_short("tests/data/image/no.exr");
    radiance();
    probing();
    other_files();
    return check_result();
}
