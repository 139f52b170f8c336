/* image_read.c -- the readers of image.h: opens a picture and chooses its codec. */
#include <string.h>

#include "common/image_codec.h"

static enum status read_source(struct image_source *source, bool probe, struct image *image, struct image_info *info,
                               struct error *err) {
    static const struct {
        const char *magic;
        size_t length;
        enum status (*read)(struct image_source *, bool, struct image *, struct image_info *, struct error *);
    } codecs[] = {
        {"\x76\x2f\x31\x01", 4, image_read_exr},
        {"\x89PNG", 4, image_read_png}, /* libpng explains what is wrong with the other four */
        {"\xff\xd8\xff", 3, image_read_jpeg},
        {"#?", 2, image_read_hdr},
    };
    struct image_info unwanted;
    if (!info)
        info = &unwanted;
    *image = (struct image){0};
    *info = (struct image_info){.orientation = 1};
    char start[8];
    size_t length = image_source_read(source, 0, start, sizeof start);
    enum status status = STATUS_INPUT;
    size_t i = 0, codec_count = sizeof codecs / sizeof codecs[0];
    while (i < codec_count && (length < codecs[i].length || memcmp(start, codecs[i].magic, codecs[i].length) != 0))
        i++;
    if (i < codec_count)
        status = codecs[i].read(source, probe, image, info, err);
    else if (source->size == 0)
        error_set(err, status, "%s: the file is empty", source->name);
    else
        error_set(err, status, "%s: not a picture in EXR, PNG, JPEG or Radiance HDR format", source->name);
    /* a truncated file may be a failing disk */
    if (source->io_error)
        status = error_set_errno(err, source->io_error, "cannot read %s", source->name);
    if (status != STATUS_OK)
        image_release(image);
    return status;
}

static enum status read_path(const char *path, bool probe, bool as_stored, struct image *image, struct image_info *info,
                             struct error *err) {
    *image = (struct image){0};
    struct image_source source;
    enum status status = image_source_open(&source, path, err);
    if (status != STATUS_OK)
        return status;
    source.as_stored = as_stored;
    status = read_source(&source, probe, image, info, err);
    image_source_close(&source);
    return status;
}

enum status image_read(const char *path, struct image *image, struct image_info *info, struct error *err) {
    return read_path(path, false, false, image, info, err);
}

enum status image_read_stored(const char *path, struct image *image, struct error *err) {
    return read_path(path, false, true, image, NULL, err);
}

enum status image_probe(const char *path, struct image *image, struct image_info *info, struct error *err) {
    return read_path(path, true, false, image, info, err);
}

enum status image_read_memory(const char *name, const void *data, size_t size, struct image *image,
                              struct image_info *info, struct error *err) {
    struct image_source source = {.name = name, .memory = data, .fd = -1, .size = size};
    return read_source(&source, false, image, info, err);
}
