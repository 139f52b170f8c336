/* profiles.h -- ICC profiles and small PNG and JPEG files that carry them, for tests. */
#ifndef UNBAKE_TESTS_PROFILES_H
#define UNBAKE_TESTS_PROFILES_H

#include <lcms2.h>
#include <stdint.h>
#include <stdio.h>
#include <zlib.h>

#include <jpeglib.h> /* which needs stdio.h */

#include "common/buf.h"
#include "common/mem.h"
#include "tests/check.h"

/* The profile's bytes in *out, which is empty; closes it. */
static inline void profile_save(cmsHPROFILE profile, struct buf *out) {
    cmsUInt32Number size = 0;
    CHECK(cmsSaveProfileToMem(profile, NULL, &size));
    void *data = mem_alloc(size);
    CHECK(cmsSaveProfileToMem(profile, data, &size));
    buf_init(out, 1 << 24);
    buf_append(out, data, size);
    mem_free(data);
    cmsCloseProfile(profile);
}

/* sRGB's curve by its parameters, or a power where gamma is not 0. */
static inline cmsToneCurve *profile_curve(double gamma) {
    static const cmsFloat64Number srgb[5] = {2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045};
    return gamma > 0 ? cmsBuildGamma(NULL, gamma) : cmsBuildParametricToneCurve(NULL, 4, srgb);
}

/* x, y of red, green, blue; white D65. */
static inline cmsHPROFILE profile_rgb(const double xy[6], double gamma, const char *name) {
    cmsCIExyY white = {0.3127, 0.3290, 1};
    cmsCIExyYTRIPLE primaries = {{xy[0], xy[1], 1}, {xy[2], xy[3], 1}, {xy[4], xy[5], 1}};
    cmsToneCurve *curve = profile_curve(gamma);
    cmsHPROFILE profile = cmsCreateRGBProfile(&white, &primaries, (cmsToneCurve *[3]){curve, curve, curve});
    cmsFreeToneCurve(curve);
    cmsMLU *text = cmsMLUalloc(NULL, 1);
    cmsMLUsetASCII(text, "en", "US", name);
    cmsWriteTag(profile, cmsSigProfileDescriptionTag, text);
    cmsMLUfree(text);
    return profile;
}

static const double profile_p3_xy[6] = {0.680, 0.320, 0.265, 0.690, 0.150, 0.060};

/* As iPhones write it. */
static inline void profile_display_p3(struct buf *out) {
    profile_save(profile_rgb(profile_p3_xy, 0, "Display P3"), out);
}

/* --- PNG by hand ------------------------------------------------------------------------------------- */

static inline void png_put32(struct buf *out, uint32_t value) {
    const uint8_t bytes[4] = {(uint8_t)(value >> 24), (uint8_t)(value >> 16), (uint8_t)(value >> 8), (uint8_t)value};
    buf_append(out, bytes, 4);
}

static inline void png_chunk(struct buf *out, const char *name, const void *data, size_t length) {
    png_put32(out, (uint32_t)length);
    size_t start = out->length;
    buf_append(out, name, 4);
    if (length > 0)
        buf_append(out, data, length);
    png_put32(out, (uint32_t)crc32_z(0, (const Bytef *)out->data + start, out->length - start));
}

static inline void png_iccp(struct buf *out, const struct buf *profile) {
    struct buf data;
    uLongf length = compressBound(profile->length);
    uint8_t *packed = mem_alloc(length);
    CHECK(compress(packed, &length, (const Bytef *)profile->data, profile->length) == Z_OK);
    buf_init(&data, 1 << 24);
    buf_append(&data, "ICC\0\0", 5);
    buf_append(&data, packed, length);
    png_chunk(out, "iCCP", data.data, data.length);
    buf_release(&data);
    mem_free(packed);
}

/* Up to the chunks that a test adds: width x 1 pixels, 8 or 16 bits, colour type 0 (grey) or 2. */
static inline void png_begin(struct buf *out, uint32_t width, int bits, int type) {
    struct buf header;
    buf_init(out, 1 << 24);
    buf_append(out, "\x89PNG\r\n\x1a\n", 8);
    buf_init(&header, 64);
    png_put32(&header, width);
    png_put32(&header, 1);
    buf_append(&header, (uint8_t[]){(uint8_t)bits, (uint8_t)type, 0, 0, 0}, 5);
    png_chunk(out, "IHDR", header.data, header.length);
    buf_release(&header);
}

/* The row's samples, of bits / 8 bytes each, and the end. */
static inline void png_end(struct buf *out, const uint16_t *sample, size_t count, int bits) {
    uint8_t row[1 + 2 * 64] = {0}, packed[512];
    uLongf length = sizeof packed;
    size_t size = 1;
    for (size_t i = 0; i < count; i++) {
        if (bits == 16)
            row[size++] = (uint8_t)(sample[i] >> 8);
        row[size++] = (uint8_t)sample[i];
    }
    CHECK(compress(packed, &length, row, size) == Z_OK);
    png_chunk(out, "IDAT", packed, length);
    png_chunk(out, "IEND", NULL, 0);
}

/* --- JPEG -------------------------------------------------------------------------------------------- */

/* A picture of 16 x 16 equal pixels of `count` (1, 3) components; profile and EXIF (with "Exif\0\0") may be NULL. */
static inline void jpeg_make(struct buf *out, const uint8_t *sample, int count, const struct buf *profile,
                             const void *exif, size_t exif_length) {
    struct jpeg_compress_struct jpeg;
    struct jpeg_error_mgr error;
    unsigned char *data = NULL;
    unsigned long length = 0;
    JSAMPLE row[16 * 3], *rows[1] = {row};
    jpeg.err = jpeg_std_error(&error);
    jpeg_create_compress(&jpeg);
    jpeg_mem_dest(&jpeg, &data, &length);
    jpeg.image_width = jpeg.image_height = 16;
    jpeg.input_components = count;
    jpeg.in_color_space = count == 1 ? JCS_GRAYSCALE : JCS_RGB;
    jpeg_set_defaults(&jpeg);
    jpeg_set_quality(&jpeg, 100, TRUE);
    jpeg_start_compress(&jpeg, TRUE);
    if (exif)
        jpeg_write_marker(&jpeg, JPEG_APP0 + 1, exif, (unsigned)exif_length);
    if (profile)
        jpeg_write_icc_profile(&jpeg, (const JOCTET *)profile->data, (unsigned)profile->length);
    for (int i = 0; i < 16 * count; i++)
        row[i] = sample[i % count];
    for (int y = 0; y < 16; y++)
        jpeg_write_scanlines(&jpeg, rows, 1);
    jpeg_finish_compress(&jpeg);
    jpeg_destroy_compress(&jpeg);
    buf_init(out, 1 << 24);
    buf_append(out, data, length);
    free(data);
}

#endif
