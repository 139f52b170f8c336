/* test_read_back.c -- a picture that is damaged on its way into its file is not taken for written: the writers read
 * back what they wrote. Here one byte of it changes between them and the system. */
#include <dlfcn.h>
#include <errno.h>
#include <sys/stat.h>

#include "common/image_codec.h"
#include "tests/check.h"

static char scratch[] = "/tmp/unbake-test-read-back-XXXXXX";
static struct error err;

/* The byte of the file that changes, -1: none; and where fwrite is. */
static long damaged_at = -1, written;

ssize_t pwrite(int fd, const void *data, size_t length, off_t at) {
    static ssize_t (*call)(int, const void *, size_t, off_t);
    if (!call)
        *(void **)&call = dlsym(RTLD_NEXT, "pwrite");
    ssize_t result = call(fd, data, length, at);
    if (damaged_at >= at && damaged_at < at + (long)length) {
        unsigned char byte = (unsigned char)(((const unsigned char *)data)[damaged_at - at] ^ 0x10);
        call(fd, &byte, 1, damaged_at);
    }
    return result;
}

size_t fwrite(const void *data, size_t size, size_t count, FILE *file) {
    static size_t (*call)(const void *, size_t, size_t, FILE *);
    if (!call)
        *(void **)&call = dlsym(RTLD_NEXT, "fwrite");
    long length = (long)(size * count), at = damaged_at - written;
    if (file == stderr || at < 0 || at >= length) {
        written += file == stderr ? 0 : length;
        return call(data, size, count, file);
    }
    unsigned char *copy = malloc((size_t)length);
    memcpy(copy, data, (size_t)length);
    copy[at] ^= 0x10;
    size_t result = call(copy, size, count, file);
    free(copy);
    written += length;
    return result;
}

static long file_size(void) {
    struct stat facts;
    return stat(scratch, &facts) == 0 ? (long)facts.st_size : 0;
}

static void make(struct image *image) {
    image_init_rgb(image, 150, 70);
    for (size_t i = 0; i < (size_t)150 * 70 * 3; i++)
        image->pixel[i] = (float)(i * 2654435761u % 4096) / 4096.0f;
    image->pixel[7] = NAN;
    image->pixel[8] = INFINITY;
    image->pixel[9] = -0.0f;
    image->pixel[10] = 1e-7f;
    image->pixel[11] = 1e9f;
}

/* Each of these bytes; those of the pixels, to the file's end, matter all. */
static void damage_exr(const struct image *image, enum image_exr_type type, bool tiled) {
    damaged_at = -1;
    CHECK_THAT(image_write_exr(scratch, image, type, tiled, &err) == STATUS_OK, "%s", err.message);
    long size = file_size(), noticed = 0, tried = 0;
    for (damaged_at = 500; damaged_at < size; damaged_at += 397) {
        enum status status = image_write_exr(scratch, image, type, tiled, &err);
        tried++;
        noticed += status == STATUS_CORRUPT && strstr(err.message, scratch) && strstr(err.message, "read back");
    }
    damaged_at = -1;
    CHECK_THAT(noticed == tried && tried > 40, "%ld of %ld noticed", noticed, tried);
}

static void damage_png(const struct image *image) {
    damaged_at = -1;
    written = 0;
    CHECK_THAT(image_write_png(scratch, image, 1, &err) == STATUS_OK, "%s", err.message);
    long size = file_size(), noticed = 0, tried = 0;
    for (damaged_at = 0; damaged_at < size; damaged_at += 19) {
        written = 0;
        enum status status = image_write_png(scratch, image, 1, &err);
        tried++;
        noticed += status == STATUS_CORRUPT && strstr(err.message, scratch) && strstr(err.message, "read back");
    }
    damaged_at = -1;
    CHECK_THAT(noticed == tried && tried > 40, "%ld of %ld noticed", noticed, tried);
}

/* A file that is whole, but of another picture. */
static void another_picture(struct image *image) {
    CHECK(image_write_exr(scratch, image, IMAGE_FLOAT, true, &err) == STATUS_OK);
    image->pixel[3 * (150 * 66 + 140) + 1] += 1e-6f;
    CHECK(image_check_exr(scratch, image, &err) == STATUS_CORRUPT && strstr(err.message, "channel G at (140, 66)"));
    CHECK(image_write_png(scratch, image, 1, &err) == STATUS_OK);
    image->pixel[3 * (150 * 66 + 140) + 1] += 0.01f;
    CHECK(image_check_png(scratch, image, 1, &err) == STATUS_CORRUPT && strstr(err.message, "row 66"));
    image->width--;
    CHECK(image_check_png(scratch, image, 1, &err) == STATUS_CORRUPT);
    image->width++;
}

/* What cannot be read back is not asked for. */
static void not_a_file(const struct image *image) {
    CHECK_THAT(image_write_png("/dev/null", image, 1, &err) == STATUS_OK, "%s", err.message);
    CHECK_THAT(image_write_exr("/dev/null", image, IMAGE_HALF, true, &err) == STATUS_OK, "%s", err.message);
}

int main(void) {
    struct image image;
    int fd = mkstemp(scratch);
    close(fd);
    make(&image);
    damage_exr(&image, IMAGE_HALF, true);
    damage_exr(&image, IMAGE_FLOAT, true);
    damage_exr(&image, IMAGE_FLOAT, false);
    damage_png(&image);
    another_picture(&image);
    not_a_file(&image);
    image_release(&image);
    unlink(scratch);
    return check_result();
}
