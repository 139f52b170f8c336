/* test_color_linear.c -- colours of files of linear light: chromaticities of EXR, primaries of Radiance, what our own
 * files say; and values as they are stored. */
#include <openexr.h>

#include "common/color.h"
#include "tests/unit/color_rig.h"

/* --- linear files ------------------------------------------------------------------------------------ */

/* One pixel, (1, 0.5, 0.25), with these chromaticities. */
static void write_exr(const exr_attr_chromaticities_t *c) {
    static const char *const names[3] = {"B", "G", "R"};
    const float value[3] = {0.25f, 0.5f, 1.0f};
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    exr_context_t context;
    exr_chunk_info_t chunk;
    exr_encode_pipeline_t pipeline = EXR_ENCODE_PIPELINE_INITIALIZER;
    int part;
    CHECK(exr_start_write(&context, scratch, EXR_WRITE_FILE_DIRECTLY, &init) == EXR_ERR_SUCCESS);
    exr_add_part(context, NULL, EXR_STORAGE_SCANLINE, &part);
    exr_initialize_required_attr_simple(context, part, 1, 1, EXR_COMPRESSION_NONE);
    exr_attr_set_chromaticities(context, part, "chromaticities", c);
    for (int i = 0; i < 3; i++)
        exr_add_channel(context, part, names[i], EXR_PIXEL_FLOAT, EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1);
    CHECK(exr_write_header(context) == EXR_ERR_SUCCESS);
    CHECK(exr_write_scanline_chunk_info(context, part, 0, &chunk) == EXR_ERR_SUCCESS);
    CHECK(exr_encoding_initialize(context, part, &chunk, &pipeline) == EXR_ERR_SUCCESS);
    for (int i = 0; i < 3; i++) {
        pipeline.channels[i].encode_from_ptr = (const uint8_t *)&value[i];
        pipeline.channels[i].user_bytes_per_element = 4;
        pipeline.channels[i].user_pixel_stride = 4;
        pipeline.channels[i].user_line_stride = 4;
        pipeline.channels[i].user_data_type = EXR_PIXEL_FLOAT;
    }
    exr_encoding_choose_default_routines(context, part, &pipeline);
    CHECK(exr_encoding_run(context, part, &pipeline) == EXR_ERR_SUCCESS);
    exr_encoding_destroy(context, &pipeline);
    exr_finish(&context);
}

static void exr_chromaticities(void) {
    static const exr_attr_chromaticities_t p3_xy = {0.680f, 0.320f, 0.265f, 0.690f, 0.150f, 0.060f, 0.3127f, 0.3290f};
    static const exr_attr_chromaticities_t none = {0, 0, 0, 0, 0, 0, 0, 0};
    struct image image;
    struct image_info info;
    write_exr(&p3_xy);
    CHECK(image_read(scratch, &image, &info, &err) == STATUS_OK && info.encoding == IMAGE_LINEAR && !image.clipped);
    pixel_is(&image, &info, 0, p3[0][0] + 0.5 * p3[0][1], p3[1][0] + 0.5 * p3[1][1],
             p3[2][0] + 0.5 * p3[2][1] + 0.25 * p3[2][2], 1e-4);
    CHECK_STRING(info.color_space, "primaries of its own, linear light");
    image_release(&image);
    write_exr(&none);
    CHECK(image_read(scratch, &image, &info, &err) == STATUS_OK && strstr(info.color_warning, "chromaticities"));
    pixel_is(&image, &info, 0, 1, 0.5, 0.25, 1e-6);
    image_release(&image);
}

static void radiance_primaries(void) {
    static const char text[] = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n"
                               "PRIMARIES= .68 .32 .265 .69 .15 .06 .3127 .329\n\n-Y 1 +X 1\n\x80\0\0\x81";
    struct buf file = {.data = (char *)text, .length = sizeof text - 1};
    struct image image;
    struct image_info info;
    if (read_bytes(&file, &image, &info)) {
        CHECK(info.encoding == IMAGE_LINEAR && info.color_space[0] != '\0');
        pixel_is(&image, &info, 0, p3[0][0], p3[1][0], p3[2][0], 1e-3);
        image_release(&image);
    }
}

/* --- our own files, and masks ------------------------------------------------------------------------- */

static void own_files(void) {
    struct image image;
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    exr_context_t context;
    exr_attr_chromaticities_t c = {0};
    image_init_rgb(&image, 2, 2);
    CHECK(image_write_exr(scratch, &image, IMAGE_HALF, true, &err) == STATUS_OK);
    CHECK(exr_start_read(&context, scratch, &init) == EXR_ERR_SUCCESS);
    CHECK(exr_attr_get_chromaticities(context, 0, "chromaticities", &c) == EXR_ERR_SUCCESS);
    exr_finish(&context);
    CHECK_NEAR(c.red_x, 0.64, 1e-6);
    CHECK_NEAR(c.white_y, 0.3290, 1e-6);
    CHECK(image_write_png(scratch, &image, 1, &err) == STATUS_OK);
    FILE *file = fopen(scratch, "rb");
    char bytes[256];
    size_t length = file ? fread(bytes, 1, sizeof bytes, file) : 0;
    CHECK(memmem(bytes, length, "sRGB", 4) != NULL);
    if (file)
        fclose(file);
    image_release(&image);
}

static void as_stored(void) {
    struct buf profile, png;
    struct image image;
    profile_display_p3(&profile);
    png_with(&profile, &png);
    FILE *file = fopen(scratch, "wb");
    fwrite(png.data, 1, png.length, file);
    fclose(file);
    CHECK(image_read_stored(scratch, &image, &err) == STATUS_OK);
    CHECK_NEAR(image.pixel[6], 200 / 255.0, 1e-7);
    CHECK(!image.clipped);
    image_release(&image);
    buf_release(&png);
    buf_release(&profile);
}

int main(void) {
    int fd = mkstemp(scratch);
    close(fd);
    exr_chromaticities();
    radiance_primaries();
    own_files();
    as_stored();
    unlink(scratch);
    return check_result();
}
