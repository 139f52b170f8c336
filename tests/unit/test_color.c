/* test_color.c -- pictures that say what their colours are: profiles and numbers against values in closed form, which
 * of several counts, what cannot be used. test_color_linear.c has the files of linear light. */
#include "common/color.h"
#include "tests/unit/color_rig.h"

/* --- matrices ---------------------------------------------------------------------------------------- */

static void matrices(void) {
    float m[3][3];
    bool is_same = true;
    CHECK(color_matrix(&color_display_p3, m, &is_same) && !is_same);
    for (int i = 0; i < 9; i++)
        CHECK_NEAR(m[i / 3][i % 3], p3[i / 3][i % 3], 1e-4);
    CHECK(color_matrix(&color_rec709, m, &is_same) && is_same);
    CHECK(color_matrix(&color_rec2020, m, &is_same) && !is_same); /* ITU-R BT.2087, table 4 */
    CHECK_NEAR(m[0][0], 1.6605, 1e-3);
    CHECK_NEAR(m[0][1], -0.5876, 1e-3);
    CHECK_NEAR(m[2][2], 1.1187, 1e-3);
    /* ACES AP0, whose blue lies below 0 and whose white is another: white stays white. */
    const struct color_primaries ap0 = {{0.7347, 0.2653}, {0.0, 1.0}, {0.0001, -0.077}, {0.32168, 0.33767}};
    CHECK(color_matrix(&ap0, m, &is_same) && !is_same);
    for (int i = 0; i < 3; i++)
        CHECK_NEAR(m[i][0] + m[i][1] + m[i][2], 1, 1e-6);
    CHECK_NEAR(m[0][0], 2.5216, 2e-3); /* the sRGB output transform of ACES 1, by CAT02's near relation */
    const struct color_primaries line = {{0.6, 0.3}, {0.4, 0.3}, {0.2, 0.3}, {0.3127, 0.3290}};
    const struct color_primaries no_white = {{0.64, 0.33}, {0.30, 0.60}, {0.15, 0.06}, {0.3, 0}};
    CHECK(!color_matrix(&line, m, &is_same) && !color_matrix(&no_white, m, &is_same));
}

/* --- profiles ---------------------------------------------------------------------------------------- */

static void is_display_p3(const struct buf *file, double tolerance) {
    struct image image;
    struct image_info info;
    if (!read_bytes(file, &image, &info))
        return;
    CHECK(info.encoding == IMAGE_CONVERTED && info.bits == 8);
    CHECK_STRING(info.color_space, "Display P3");
    CHECK_STRING(info.color_warning, "");
    pixel_is(&image, &info, 0, p3[0][0], p3[1][0], p3[2][0], tolerance);
    pixel_is(&image, &info, 1, p3[0][1], p3[1][1], p3[2][1], tolerance);
    double in[3] = {srgb(200 / 255.0), srgb(150 / 255.0), srgb(100 / 255.0)}, out[3];
    for (int i = 0; i < 3; i++)
        out[i] = p3[i][0] * in[0] + p3[i][1] * in[1] + p3[i][2] * in[2];
    pixel_is(&image, &info, 2, out[0], out[1], out[2], tolerance);
    pixel_is(&image, &info, 3, 1, 1, 1, tolerance);
    CHECK(image.clipped && image.clipped[0] == 1 && image.clipped[1] == 2 && image.clipped[2] == 0 &&
          image.clipped[3] == 7);
    CHECK(info.outside_count == 2);
    CHECK_NEAR(info.clip, srgb(250 / 255.0), tolerance);
    image_release(&image);
}

static void png_profile(void) {
    struct buf profile, file;
    profile_display_p3(&profile);
    png_with(&profile, &file);
    is_display_p3(&file, 1e-3);
    buf_release(&file);
    /* 16 bits, whose small values are no steps of 8. */
    struct image image;
    struct image_info info;
    png_begin(&file, 1, 16, 2);
    png_iccp(&file, &profile);
    png_end(&file, (const uint16_t[]){1000, 1000, 1000}, 3, 16);
    if (read_bytes(&file, &image, &info)) {
        pixel_is(&image, &info, 0, srgb(1000 / 65535.0), srgb(1000 / 65535.0), srgb(1000 / 65535.0), 1e-5);
        image_release(&image);
    }
    buf_release(&file);
    buf_release(&profile);
}

/* A profile of three-dimensional tables says the same as one of curves, as well as its tables can. */
static cmsInt32Number sample_p3(const cmsUInt16Number in[], cmsUInt16Number out[], void *transform) {
    cmsDoTransform(transform, in, out, 1);
    return TRUE;
}

static void png_tables(void) {
    struct buf profile, file;
    cmsHPROFILE matrix = profile_rgb(profile_p3_xy, 0, "Display P3"), lab = cmsCreateLab4Profile(NULL);
    cmsHTRANSFORM transform =
        cmsCreateTransform(matrix, TYPE_RGB_16, lab, TYPE_Lab_16, INTENT_RELATIVE_COLORIMETRIC, cmsFLAGS_NOOPTIMIZE);
    cmsHPROFILE tables = profile_rgb(profile_p3_xy, 0, "Display P3");
    cmsSetPCS(tables, cmsSigLabData);
    cmsSetDeviceClass(tables, cmsSigInputClass);
    cmsPipeline *pipeline = cmsPipelineAlloc(NULL, 3, 3);
    cmsStage *grid = cmsStageAllocCLut16bit(NULL, 33, 3, 3, NULL);
    cmsStageSampleCLut16bit(grid, sample_p3, transform, 0);
    cmsPipelineInsertStage(pipeline, cmsAT_BEGIN, cmsStageAllocToneCurves(NULL, 3, NULL));
    cmsPipelineInsertStage(pipeline, cmsAT_END, grid);
    cmsPipelineInsertStage(pipeline, cmsAT_END, cmsStageAllocToneCurves(NULL, 3, NULL));
    CHECK(cmsWriteTag(tables, cmsSigAToB0Tag, pipeline));
    cmsPipelineFree(pipeline);
    profile_save(tables, &profile);
    png_with(&profile, &file);
    is_display_p3(&file, 0.02);
    buf_release(&file);
    buf_release(&profile);
    cmsDeleteTransform(transform);
    cmsCloseProfile(lab);
    cmsCloseProfile(matrix);
}

/* Most files with a profile have this one: their values are not touched. */
static void profile_of_srgb(void) {
    struct buf profile, file;
    struct image image;
    struct image_info info;
    profile_save(cmsCreate_sRGBProfile(), &profile);
    png_with(&profile, &file);
    if (read_bytes(&file, &image, &info)) {
        CHECK(info.encoding == IMAGE_SRGB && info.color_space[0] == '\0' && info.color_warning[0] == '\0' &&
              !image.clipped);
        CHECK_NEAR(image.pixel[6], 200 / 255.0, 1e-7);
        image_release(&image);
    }
    buf_release(&file);
    buf_release(&profile);
}

static void grey(void) {
    struct buf profile, file;
    struct image image;
    struct image_info info;
    cmsToneCurve *curve = cmsBuildGamma(NULL, 1.8);
    cmsCIExyY white = {0.3127, 0.3290, 1};
    profile_save(cmsCreateGrayProfile(&white, curve), &profile);
    cmsFreeToneCurve(curve);
    png_begin(&file, 2, 8, 0);
    png_iccp(&file, &profile);
    png_end(&file, (const uint16_t[]){100, 255}, 2, 8);
    if (read_bytes(&file, &image, &info)) {
        double value = pow(100 / 255.0, 1.8);
        CHECK(info.encoding == IMAGE_CONVERTED && image.clipped && image.clipped[0] == 0 && image.clipped[1] == 7);
        pixel_is(&image, &info, 0, value, value, value, 2e-3);
        pixel_is(&image, &info, 1, 1, 1, 1, 2e-3);
        image_release(&image);
    }
    buf_release(&file);
    png_with(&profile, &file); /* of a colour picture it says nothing */
    if (read_bytes(&file, &image, &info)) {
        CHECK(info.encoding == IMAGE_SRGB && strstr(info.color_warning, "is not of red, green and blue"));
        image_release(&image);
    }
    buf_release(&file);
    buf_release(&profile);
    profile_display_p3(&profile); /* of a grey picture a colour profile says the curve */
    jpeg_make(&file, (const uint8_t[]){100}, 1, &profile, NULL, 0);
    if (read_bytes(&file, &image, &info)) {
        pixel_is(&image, &info, 0, srgb(100 / 255.0), srgb(100 / 255.0), srgb(100 / 255.0), 1e-3);
        image_release(&image);
    }
    buf_release(&file);
    buf_release(&profile);
}

/* A profile that takes several segments; and one of which a segment is missing. */
static void jpeg_profile(void) {
    struct buf profile, file;
    struct image image;
    struct image_info info;
    cmsHPROFILE large = profile_rgb(profile_p3_xy, 0, "Display P3");
    cmsMLU *text = cmsMLUalloc(NULL, 1);
    char *filler = mem_alloc(100001);
    memset(filler, 'x', 100000);
    filler[100000] = '\0';
    cmsMLUsetASCII(text, "en", "US", filler);
    cmsWriteTag(large, cmsSigCopyrightTag, text);
    cmsMLUfree(text);
    mem_free(filler);
    profile_save(large, &profile);
    CHECK(profile.length > 2 * 65533);
    jpeg_make(&file, (const uint8_t[]){200, 150, 100}, 3, &profile, NULL, 0);
    double in[3] = {srgb(200 / 255.0), srgb(150 / 255.0), srgb(100 / 255.0)};
    if (read_bytes(&file, &image, &info)) {
        CHECK_STRING(info.color_space, "Display P3");
        pixel_is(&image, &info, 40, p3[0][0] * in[0] + p3[0][1] * in[1], p3[1][0] * in[0] + p3[1][1] * in[1],
                 p3[2][0] * in[0] + p3[2][1] * in[1] + p3[2][2] * in[2], 0.01);
        image_release(&image);
    }
    char *second = memmem(file.data, file.length, "ICC_PROFILE\0\2", 13);
    CHECK(second != NULL);
    if (second)
        second[12] = 9; /* of four, say */
    if (read_bytes(&file, &image, &info)) {
        CHECK(info.encoding == IMAGE_SRGB && strstr(info.color_warning, "do not fit together"));
        pixel_is(&image, &info, 40, in[0], in[1], in[2], 0.01);
        image_release(&image);
    }
    buf_release(&file);
    buf_release(&profile);
}

static void bad_profiles(void) {
    struct buf profile, file;
    struct image image;
    struct image_info info;
    profile_display_p3(&profile);
    for (size_t length = 0; length < profile.length; length += 37) { /* cut, wherever */
        struct buf cut = {.data = profile.data, .length = length};
        png_with(&cut, &file);
        if (read_bytes(&file, &image, &info)) {
            CHECK_THAT(info.encoding == IMAGE_SRGB ? strstr(info.color_warning, "its ICC profile is damaged") != NULL
                                                   : info.color_space[0] != '\0',
                       "at %zu: '%s', '%s'", length, info.color_warning, info.color_space);
            image_release(&image);
        }
        buf_release(&file);
    }
    memcpy(profile.data + 16, "CMYK", 4);
    png_with(&profile, &file);
    if (read_bytes(&file, &image, &info)) {
        CHECK(info.encoding == IMAGE_SRGB && strstr(info.color_warning, "is not of red, green and blue"));
        image_release(&image);
    }
    buf_release(&file);
    buf_release(&profile);
}

/* --- numbers ----------------------------------------------------------------------------------------- */

/* Chunks of a PNG, as bits of a set. */
enum { CICP = 1, ICCP = 2, SRGB = 4, CHRM = 8, GAMA = 16 };

/* cICP: linear Display P3; iCCP: Display P3; cHRM: those of Rec. 2020; gAMA: as given. Reads a pixel of stored .5. */
static void numbers(int chunks, uint32_t gama, const char *space, double r, double b) {
    static const uint32_t rec2020[8] = {31270, 32900, 70800, 29200, 17000, 79700, 13100, 4600};
    struct buf profile, file, chrm;
    struct image image;
    struct image_info info;
    profile_display_p3(&profile);
    png_begin(&file, 2, 16, 2);
    buf_init(&chrm, 64);
    for (int i = 0; i < 8; i++)
        png_put32(&chrm, rec2020[i]);
    if (chunks & GAMA) /* in the wrong order, which does not matter */
        png_chunk(&file, "gAMA", (const uint8_t[]){0, (uint8_t)(gama >> 16), (uint8_t)(gama >> 8), (uint8_t)gama}, 4);
    if (chunks & CHRM)
        png_chunk(&file, "cHRM", chrm.data, chrm.length);
    if (chunks & SRGB)
        png_chunk(&file, "sRGB", "\0", 1);
    if (chunks & ICCP)
        png_iccp(&file, &profile);
    if (chunks & CICP)
        png_chunk(&file, "cICP", (const uint8_t[]){12, 8, 0, 1}, 4);
    png_end(&file, (const uint16_t[]){65535, 0, 0, 32768, 32768, 32768}, 6, 16);
    if (read_bytes(&file, &image, &info)) {
        double middle[2] = {(double)image.pixel[3], (double)image.pixel[0]};
        if (info.encoding == IMAGE_SRGB)
            middle[0] = srgb(middle[0]);
        CHECK_STRING(info.color_space, space);
        CHECK_STRING(info.color_warning, "");
        CHECK_THAT(fabs(middle[0] - b) < 1e-3 && fabs(middle[1] - r) < 2e-3, "chunks %d: grey %g, red %g", chunks,
                   middle[0], middle[1]);
        image_release(&image);
    }
    buf_release(&chrm);
    buf_release(&file);
    buf_release(&profile);
}

static void precedence(void) {
    double half = 32768 / 65535.0;
    numbers(0, 0, "", 1, srgb(half));
    numbers(GAMA, 100000, "linear light", 1, half);
    numbers(GAMA, 45455, "", 1, srgb(half)); /* sRGB's stand-in */
    numbers(GAMA, 55556, "gamma 1.8", 1, pow(half, 1.8));
    numbers(CHRM, 0, "primaries of its own", 1.6605, srgb(half));
    numbers(CHRM | GAMA, 100000, "primaries of its own, linear light", 1.6605, half);
    numbers(CHRM | GAMA | SRGB, 100000, "", 1, srgb(half));
    numbers(CHRM | GAMA | SRGB | ICCP, 100000, "Display P3", 1.2249, srgb(half));
    numbers(CHRM | GAMA | SRGB | ICCP | CICP, 100000, "Display P3, linear", 1.2249, half);
}

static void cicp(uint8_t primaries, uint8_t transfer, uint8_t matrix, uint8_t range, const char *space,
                 const char *warning, double middle) {
    struct buf file;
    struct image image;
    struct image_info info;
    png_begin(&file, 1, 16, 2);
    png_chunk(&file, "cICP", (const uint8_t[]){primaries, transfer, matrix, range}, 4);
    png_end(&file, (const uint16_t[]){32768, 32768, 32768}, 3, 16);
    if (read_bytes(&file, &image, &info)) {
        CHECK_STRING(info.color_space, space);
        CHECK_THAT(strstr(info.color_warning, warning) && !info.color_warning[0] == !*warning, "%s",
                   info.color_warning);
        double found = (double)image.pixel[1];
        CHECK_NEAR(info.encoding == IMAGE_SRGB ? srgb(found) : found, middle, 1e-3);
        image_release(&image);
    }
    buf_release(&file);
}

static void codes(void) {
    double half = 32768 / 65535.0;
    cicp(1, 13, 0, 1, "", "", srgb(half));
    cicp(12, 13, 0, 1, "Display P3", "", srgb(half));
    cicp(9, 14, 0, 1, "Rec. 2020, its curve", "", pow((half + 0.099) / 1.099, 1 / 0.45));
    cicp(9, 16, 0, 1, "Rec. 2020, PQ", "", 92.2457 / 203); /* ST 2084: half of the range is 92.2457 cd/m2 */
    cicp(9, 18, 0, 1, "Rec. 2020, HLG", "", 1 / 12.0);
    cicp(9, 13, 1, 1, "", "which are not known here", srgb(half)); /* Y Cb Cr is no PNG */
    cicp(9, 13, 0, 0, "", "which are not known here", srgb(half));
    cicp(22, 13, 0, 1, "", "which are not known here", srgb(half));
}

static void damaged_chunks(void) {
    struct buf file;
    struct image image;
    struct image_info info;
    png_begin(&file, 1, 8, 2);
    size_t at = file.length;
    png_chunk(&file, "gAMA", "\0\1\x86\xa0", 4);
    png_end(&file, (const uint16_t[]){128, 128, 128}, 3, 8);
    file.data[at + 9] ^= 1;
    if (read_bytes(&file, &image, &info)) {
        CHECK(info.encoding == IMAGE_SRGB && strstr(info.color_warning, "gAMA is damaged"));
        image_release(&image);
    }
    buf_release(&file);
    png_begin(&file, 1, 8, 2);
    png_chunk(&file, "gAMA", "\0\0\0\0", 4);
    png_end(&file, (const uint16_t[]){128, 128, 128}, 3, 8);
    if (read_bytes(&file, &image, &info)) {
        CHECK(info.encoding == IMAGE_SRGB && strstr(info.color_warning, "cannot be"));
        image_release(&image);
    }
    buf_release(&file);
}

/* What cameras write that have no profile: IFD0 -> Exif IFD -> interoperability IFD, index "R03". */
static void adobe_rgb(void) {
    static const char exif[] = "Exif\0\0II*\0\10\0\0\0"
                               "\1\0"
                               "\x69\x87\4\0\1\0\0\0\32\0\0\0"
                               "\0\0\0\0"
                               "\2\0"
                               "\1\xa0\3\0\1\0\0\0\xff\xff\0\0"
                               "\5\xa0\4\0\1\0\0\0\70\0\0\0"
                               "\0\0\0\0"
                               "\1\0"
                               "\1\0\2\0\4\0\0\0R03\0"
                               "\0\0\0\0";
    struct buf file, profile;
    struct image image;
    struct image_info info;
    jpeg_make(&file, (const uint8_t[]){100, 100, 100}, 3, NULL, exif, sizeof exif - 1);
    if (read_bytes(&file, &image, &info)) {
        double value = pow(100 / 255.0, 563 / 256.0);
        CHECK_STRING(info.color_space, "Adobe RGB");
        pixel_is(&image, &info, 0, value, value, value, 1e-3);
        image_release(&image);
    }
    buf_release(&file);
    char other[sizeof exif];
    memcpy(other, exif, sizeof exif);
    other[sizeof exif - 1 - 4 - 2] = '8'; /* R98: sRGB by DCF, and yet uncalibrated */
    jpeg_make(&file, (const uint8_t[]){100, 100, 100}, 3, NULL, other, sizeof exif - 1);
    if (read_bytes(&file, &image, &info)) {
        CHECK(info.encoding == IMAGE_SRGB && strstr(info.color_warning, "its EXIF says"));
        image_release(&image);
    }
    buf_release(&file);
    profile_display_p3(&profile); /* which wins */
    jpeg_make(&file, (const uint8_t[]){100, 100, 100}, 3, &profile, exif, sizeof exif - 1);
    if (read_bytes(&file, &image, &info)) {
        CHECK_STRING(info.color_space, "Display P3");
        image_release(&image);
    }
    buf_release(&file);
    buf_release(&profile);
}

int main(void) {
    int fd = mkstemp(scratch);
    close(fd);
    matrices();
    png_profile();
    png_tables();
    profile_of_srgb();
    grey();
    jpeg_profile();
    bad_profiles();
    precedence();
    codes();
    damaged_chunks();
    adobe_rgb();
    unlink(scratch);
    return check_result();
}
