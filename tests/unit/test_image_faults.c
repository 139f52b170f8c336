/* test_image_faults.c -- pictures where the disk or a library fails, or a file asks for more than a picture may have:
 * each is told for what it is, and a failing disk is never called a damaged picture. */
#include <openexr.h>
#include <png.h>
#include <stdio.h>
#include <zlib.h>

#include <jpeglib.h> /* which needs stdio.h */

#include "common/file.h"
#include "common/image.h"
#include "common/mem.h"
#include "tests/check.h"
#include "tests/system_faults.h"

static struct error err;
static char dir[] = "/tmp/unbake-test-image-XXXXXX";
static char *path;

#define OK(call) CHECK_THAT((call) == STATUS_OK, "%s", err.message)
/* Refused so, by a sentence with `word`. */
#define IS(call, wanted, word)                                                                                         \
    do {                                                                                                               \
        enum status check_status = (call);                                                                             \
        CHECK_THAT(check_status == (wanted) && strstr(err.message, word), "%s: %s", status_name(check_status),         \
                   err.message);                                                                                       \
    } while (0)

/* The library does not start while this is set, as another version of it would not. */
static bool png_is_broken;
png_infop png_create_info_struct(png_const_structrp png) {
    png_infop (*call)(png_const_structrp);
    *(void **)&call = dlsym(RTLD_NEXT, "png_create_info_struct");
    return png_is_broken ? NULL : call(png);
}

/* What was written cannot be kept, and this is told when it is closed. */
static bool closing_is_broken;
int fclose(FILE *file) {
    int (*call)(FILE *);
    *(void **)&call = dlsym(RTLD_NEXT, "fclose");
    int result = call(file);
    if (closing_is_broken)
        errno = EIO;
    return closing_is_broken ? EOF : result;
}

static enum status read_path(const char *from) {
    struct image image;
    enum status status = image_read(from, &image, NULL, &err);
    CHECK(status == STATUS_OK || (!image.pixel && !image.channel));
    image_release(&image);
    return status;
}

static enum status read_bytes(const void *data, size_t size) {
    struct image image;
    enum status status = image_read_memory("case", data, size, &image, NULL, &err);
    CHECK(status == STATUS_OK || (!image.pixel && !image.channel));
    image_release(&image);
    return status;
}

/* --- the disk --------------------------------------------------------------------------------------- */

/* Each call that reads fails once, by EIO and ENOSPC in turn. */
static void check_reading(void) {
    static const char radiance[] = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\nabcdefgh";
    const char *const files[] = {"tests/data/image/exif_little.jpg", "tests/data/image/exif.png",
                                 "tests/data/image/zip.exr", path};
    OK(file_replace(path, radiance, sizeof radiance - 1, &err));
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        bool struck = true;
        for (long n = 1; struck && check_failed_count == 0; n++) {
            system_faults_arm(n);
            enum status status = read_path(files[i]);
            struck = system_faults_lift();
            enum status wanted = !struck ? STATUS_OK : system_fault == ENOSPC ? STATUS_NO_SPACE : STATUS_IO;
            CHECK_THAT(status == wanted, "%s, call %ld: %s, not %s: %s", files[i], n, status_name(status),
                       status_name(wanted), err.message);
            CHECK(!struck || strstr(err.message, files[i]));
        }
    }
}

static void check_writing(void) {
    struct image image;
    image_init_rgb(&image, 300, 300); /* more than libc collects before it writes */
    for (size_t i = 0; i < (size_t)300 * 300 * 3; i++)
        image.pixel[i] = (float)(i * 2654435761u % 4096) / 4096.0f;
    IS(image_write_png("/nonexistent/a.png", &image, 1, &err), STATUS_NOT_FOUND, "cannot create");
    if (access("/dev/full", W_OK) == 0) {
        for (int i = 0; i < 2; i++) { /* what came first is told */
            closing_is_broken = i;
            IS(image_write_png("/dev/full", &image, 1, &err), STATUS_NO_SPACE, "/dev/full");
        }
        IS(image_write_exr("/dev/full", &image, IMAGE_FLOAT, false, &err), STATUS_NO_SPACE, "/dev/full");
    }
    closing_is_broken = true;
    IS(image_write_png(path, &image, 1, &err), STATUS_IO, path);
    closing_is_broken = false;
    system_break(" close ", EIO);
    IS(image_write_exr(path, &image, IMAGE_HALF, false, &err), STATUS_IO, "cannot close");
    system_break(" pwrite close ", ENOSPC);
    IS(image_write_exr(path, &image, IMAGE_HALF, false, &err), STATUS_NO_SPACE, "cannot write");
    system_mend();
    OK(image_write_exr(path, &image, IMAGE_HALF, false, &err));
    OK(read_path(path));
    image_release(&image);
}

/* --- the libraries ---------------------------------------------------------------------------------- */

static void check_libraries(void) {
    static const char *const twice[] = {"A", "A"};
    struct image image;
    image_init_rgb(&image, 4, 4);
    OK(image_write_png(path, &image, 1, &err));
    png_is_broken = true;
    IS(read_path(path), STATUS_INTERNAL, "libpng does not start");
    IS(image_write_png(path, &image, 1, &err), STATUS_INTERNAL, "libpng does not start");
    png_is_broken = false;
    OK(image_write_png(path, &image, 1, &err));
    OK(read_path(path));
    image.height = 0; /* what no PNG can have */
    IS(image_write_png(path, &image, 1, &err), STATUS_INTERNAL, "cannot write");
    image_release(&image);
    image_init(&image, 4, 4, 2, twice);
    IS(image_write_exr(path, &image, IMAGE_HALF, false, &err), STATUS_INTERNAL, "cannot write");
    image_release(&image);
}

/* --- too much --------------------------------------------------------------------------------------- */

static void put32(unsigned char *to, uint32_t value) {
    for (int i = 0; i < 4; i++)
        to[i] = (unsigned char)(value >> (24 - 8 * i));
}

static void check_sizes(void) {
    static const char radiance[] = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8000 +X 60000\n\2\2\1\1";
    static const char *const names[IMAGE_MAX_CHANNELS + 1] = {"R"};
    struct image image;
    struct buf file;
    IS(read_bytes(radiance, sizeof radiance - 1), STATUS_INPUT, "cannot hold 60000 x 8000 pixels");
    IS(image_header(&image, "case", 1, 1, IMAGE_MAX_CHANNELS + 1, names, &err), STATUS_LIMIT, "65 channels");

    image_init_rgb(&image, 4, 4);
    OK(image_write_png(path, &image, 1, &err));
    image_release(&image);
    buf_init(&file, 1 << 20);
    OK(file_read(path, &file, &err));
    unsigned char *chunk = (unsigned char *)file.data + 12; /* "IHDR", width, height; its CRC at 17 */
    put32(chunk + 4, IMAGE_MAX_SIDE);
    put32(chunk + 8, IMAGE_MAX_SIDE);
    put32(chunk + 17, (uint32_t)crc32(0, chunk, 17));
    IS(read_bytes(file.data, file.length), STATUS_LIMIT, "65536 x 65536 pixels");
    buf_release(&file);

    buf_init(&file, 1 << 20);
    OK(file_read("tests/data/image/exif_little.jpg", &file, &err));
    size_t frame = 0; /* FF C0: the start of a frame */
    while (frame + 9 < file.length && memcmp(file.data + frame, "\xff\xc0\0\x11\x08", 5) != 0)
        frame++;
    CHECK(frame + 9 < file.length);
    memcpy(file.data + frame + 5, "\xff\xdc\xff\xdc", 4);
    IS(read_bytes(file.data, file.length), STATUS_LIMIT, "65500 x 65500 pixels");
    buf_release(&file);
}

/* A grey square, in so many scans: first all there is of light, then a bit of a frequency at a time. */
static enum status read_scans(int count) {
    struct jpeg_compress_struct jpeg;
    struct jpeg_error_mgr errors;
    jpeg_scan_info scans[631] = {{.comps_in_scan = 1}};
    unsigned char *data = NULL, row[8] = {0, 255, 3, 99, 0, 200, 17, 80};
    unsigned long size = 0;
    for (int k = 1, i = 1; k < 64; k++)
        for (int bit = 9; bit >= 0; bit--, i++)
            scans[i] = (jpeg_scan_info){.comps_in_scan = 1, .Ss = k, .Se = k, .Ah = bit == 9 ? 0 : bit + 1, .Al = bit};
    jpeg.err = jpeg_std_error(&errors);
    jpeg_create_compress(&jpeg);
    jpeg_mem_dest(&jpeg, &data, &size);
    jpeg.image_width = jpeg.image_height = 8;
    jpeg.input_components = 1;
    jpeg.in_color_space = JCS_GRAYSCALE;
    jpeg_set_defaults(&jpeg);
    jpeg.scan_info = scans;
    jpeg.num_scans = count;
    jpeg_start_compress(&jpeg, TRUE);
    for (int y = 0; y < 8; y++)
        jpeg_write_scanlines(&jpeg, (JSAMPROW[]){row}, 1);
    jpeg_finish_compress(&jpeg);
    enum status status = read_bytes(data, size);
    jpeg_destroy_compress(&jpeg);
    free(data);
    return status;
}

static char header[16384];
static size_t header_size;

static int64_t write_header(exr_const_context_t context, void *user, const void *data, uint64_t size, uint64_t offset,
                            exr_stream_error_func_ptr_t report) {
    (void)context, (void)user, (void)report;
    CHECK(offset + size <= sizeof header);
    memcpy(header + offset, data, size);
    header_size = offset + size > header_size ? offset + size : header_size;
    return (int64_t)size;
}

/* The header of an EXR with channels of these names, as other programs may write it. */
static void make_header(const char *const *names, int count) {
    exr_context_t context;
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    int part = 0;
    init.write_fn = write_header;
    header_size = 0;
    CHECK(exr_start_write(&context, "case", EXR_WRITE_FILE_DIRECTLY, &init) == EXR_ERR_SUCCESS);
    CHECK(exr_set_longname_support(context, 1) == EXR_ERR_SUCCESS);
    CHECK(exr_add_part(context, NULL, EXR_STORAGE_SCANLINE, &part) == EXR_ERR_SUCCESS);
    CHECK(exr_initialize_required_attr_simple(context, part, 1, 1, EXR_COMPRESSION_NONE) == EXR_ERR_SUCCESS);
    for (int i = 0; i < count; i++)
        CHECK(exr_add_channel(context, part, names[i], EXR_PIXEL_FLOAT, EXR_PERCEPTUALLY_LINEAR, 1, 1) ==
              EXR_ERR_SUCCESS);
    CHECK(exr_write_header(context) == EXR_ERR_SUCCESS);
    exr_finish(&context);
}

static void check_channels(void) {
    char names[IMAGE_MAX_CHANNELS][16], name[65];
    const char *all[IMAGE_MAX_CHANNELS];
    for (int i = 0; i < IMAGE_MAX_CHANNELS; i++) {
        snprintf(names[i], sizeof names[i], "c%02d", i);
        all[i] = names[i];
    }
    make_header(all, IMAGE_MAX_CHANNELS - 1);
    IS(read_bytes(header, header_size), STATUS_LIMIT, "63 channels are more than the limit of 62");
    make_header(all, 2);
    for (char *at = header; at + 4 < header + header_size; at++)
        if (memcmp(at, "c01", 4) == 0)
            at[2] = '0';
    IS(read_bytes(header, header_size), STATUS_INPUT, "duplicate channel");
    memset(name, 'n', sizeof name - 1);
    name[sizeof name - 1] = '\0';
    all[0] = name;
    make_header(all, 1);
    IS(read_bytes(header, header_size), STATUS_INPUT, "is too long");
}

int main(void) {
    if (!mkdtemp(dir))
        return 1;
    path = file_join(dir, "picture");
    check_reading();
    check_writing();
    check_libraries();
    check_sizes();
    OK(read_scans(500));
    IS(read_scans(501), STATUS_INPUT, "more than 500 scans");
    check_channels();
    mem_free(path);
    OK(file_remove_tree(dir, &err));
    return check_result();
}
