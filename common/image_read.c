/* image_read.c -- the readers of image.h: opens a picture and chooses its codec. */
#include <string.h>

#include "common/image_codec.h"
#include "common/image_foreign.h"

/* Kinds that are read, by their first bytes. */
struct codec {
    size_t offset;
    const char *magic;
    size_t length;
    enum status (*read)(struct image_source *, bool, struct image *, struct image_info *, struct error *);
};
#define START_BYTES 32 /* of a file, by which its format is recognised */

static const struct codec codecs[] = {
    {0, "\x76\x2f\x31\x01", 4, image_read_exr},
    {0, "\x89PNG", 4, image_read_png}, /* libpng explains what is wrong with the other four */
    {0, "\xff\xd8\xff", 3, image_read_jpeg},
    {0, "#?", 2, image_read_hdr},
    {0, "II*\0", 4, image_read_tiff},
    {0, "MM\0*", 4, image_read_tiff},
    {0, "II+\0", 4, image_read_tiff}, /* BigTIFF */
    {0, "MM\0+", 4, image_read_tiff},
    {8, "WEBP", 4, image_read_webp},
    {4, "ftypheic", 8, image_read_heif}, /* brands: ISO/IEC 23008-12, annex B; AVIF 1.1, section 8 */
    {4, "ftypheix", 8, image_read_heif},
    {4, "ftyphevc", 8, image_read_heif},
    {4, "ftypheim", 8, image_read_heif},
    {4, "ftypheis", 8, image_read_heif},
    {4, "ftypmif1", 8, image_read_heif},
    {4, "ftypmif2", 8, image_read_heif},
    {4, "ftypmsf1", 8, image_read_heif},
    {4, "ftypavif", 8, image_read_heif},
    {4, "ftypavis", 8, image_read_heif},
};

static const struct codec *find_codec(const char *start, size_t length) {
    for (const struct codec *c = codecs; c < codecs + sizeof codecs / sizeof *codecs; c++)
        if (length >= c->offset + c->length && memcmp(start + c->offset, c->magic, c->length) == 0)
            return c;
    return NULL;
}

static enum status read_source(struct image_source *source, bool probe, struct image *image, struct image_info *info,
                               struct error *err) {
    struct image_info unwanted;
    if (!info)
        info = &unwanted;
    *image = (struct image){0};
    *info = (struct image_info){.orientation = 1};
    char start[START_BYTES];
    size_t length = image_source_read(source, 0, start, sizeof start);
    enum status status = STATUS_INPUT;
    bool is_foreign = image_is_foreign(source->name, start, length, err);
    const struct codec *codec = is_foreign ? NULL : find_codec(start, length);
    if (codec)
        status = codec->read(source, probe, image, info, err);
    else if (source->size == 0)
        error_set(err, status, "%s: the file is empty", source->name);
    else if (!is_foreign)
        error_set(err, status, "%s: not a picture in " IMAGE_FORMATS " format", source->name);
    /* a truncated file may be a failing disk */
    if (source->io_error)
        status = error_set_errno(err, source->io_error, "cannot read %s", source->name);
    if (status != STATUS_OK)
        image_release(image);
    return status;
}

/* `how` has the flags of the source. */
static enum status read_path(const char *path, bool probe, struct image_source how, struct image *image,
                             struct image_info *info, struct error *err) {
    *image = (struct image){0};
    struct image_source source;
    enum status status = image_source_open(&source, path, err);
    if (status != STATUS_OK)
        return status;
    source.as_stored = how.as_stored;
    source.wants_color = how.wants_color;
    status = read_source(&source, probe, image, info, err);
    image_source_close(&source);
    return status;
}

enum status image_read(const char *path, struct image *image, struct image_info *info, struct error *err) {
    return read_path(path, false, (struct image_source){0}, image, info, err);
}

enum status image_read_photograph(const char *path, struct image *image, struct image_info *info, struct error *err) {
    return read_path(path, false, (struct image_source){.wants_color = true}, image, info, err);
}

enum status image_read_stored(const char *path, struct image *image, struct error *err) {
    return read_path(path, false, (struct image_source){.as_stored = true}, image, NULL, err);
}

enum status image_probe(const char *path, struct image *image, struct image_info *info, struct error *err) {
    return read_path(path, true, (struct image_source){0}, image, info, err);
}

enum status image_probe_photograph(const char *path, struct image *image, struct image_info *info, struct error *err) {
    return read_path(path, true, (struct image_source){.wants_color = true}, image, info, err);
}

enum status image_read_memory(const char *name, const void *data, size_t size, struct image *image,
                              struct image_info *info, struct error *err) {
    struct image_source source = {.name = name, .memory = data, .fd = -1, .size = size};
    return read_source(&source, false, image, info, err);
}

enum status image_read_memory_stored(const char *name, const void *data, size_t size, struct image *image,
                                     struct error *err) {
    struct image_source source = {.name = name, .memory = data, .fd = -1, .size = size, .as_stored = true};
    return read_source(&source, false, image, NULL, err);
}
