/* image_codec.h -- what the codecs (exr_*.c, hdr.c, heif.c, jpeg.c, png_*.c, tiff*.c, webp.c) share with image_read.c,
 * which chooses among them; private to them.
 *
 * A codec reads from a source, which is a file or memory, at any offset: nothing is loaded
 * whole, so probing a large file costs as little as reading its header. A codec fills *image
 * only through image_header and image_allocate, which enforce the limits of image.h. */
#ifndef UNBAKE_COMMON_IMAGE_CODEC_H
#define UNBAKE_COMMON_IMAGE_CODEC_H

#include "common/color.h"
#include "common/image.h"

struct image_source {
    const char *name;      /* for messages */
    const uint8_t *memory; /* NULL for a file */
    int fd;
    uint64_t size;    /* bytes */
    int io_error;     /* errno of the first read that the system refused, else 0 */
    bool as_stored;   /* values of PNG and JPEG are not converted */
    bool wants_color; /* only the picture's R, G, B and A */
};

/* Opens a file (a FIFO under a picture's name does not block) that must be a regular one; `path` is borrowed. */
enum status image_source_open(struct image_source *source, const char *path, struct error *err);
void image_source_close(struct image_source *source);

/* Reads up to `length` bytes at `offset`; fewer only at the end or after an I/O error. */
size_t image_source_read(struct image_source *source, uint64_t offset, void *buffer, size_t length);

/* Converts a picture with values in [0, 1] by *color and records it in *info; releases *color. */
void image_convert(struct image *image, struct image_info *info, struct color *color);

/* Colours (the first three of four channels) that were multiplied by alpha become those of the surface, up to
 * `most`. */
void image_divide_by_alpha(struct image *image, float most);

/* Colour space from EXIF, for files without a better source. */
void image_color_by_exif(const struct image_info *info, struct color *color);

/* The names of a colour picture's channels, for image_header. */
extern const char *const image_rgba[4];

/* One reader per format. With `probe` they stop after the header. The source's first bytes
 * were recognised. On error the caller releases *image. */
enum status image_read_exr(struct image_source *source, bool probe, struct image *image, struct image_info *info,
                           struct error *err);
enum status image_read_hdr(struct image_source *source, bool probe, struct image *image, struct image_info *info,
                           struct error *err);
enum status image_read_png(struct image_source *source, bool probe, struct image *image, struct image_info *info,
                           struct error *err);
enum status image_read_jpeg(struct image_source *source, bool probe, struct image *image, struct image_info *info,
                            struct error *err);

enum status image_read_heif(struct image_source *source, bool probe, struct image *image, struct image_info *info,
                            struct error *err);
enum status image_read_tiff(struct image_source *source, bool probe, struct image *image, struct image_info *info,
                            struct error *err);
enum status image_read_webp(struct image_source *source, bool probe, struct image *image, struct image_info *info,
                            struct error *err);

/* Whether written files hold these pictures; called by image_write_exr and image_write_png. STATUS_CORRUPT says what
 * a reader finds instead. */
enum status image_check_exr(const char *path, const struct image *image, struct error *err);
enum status image_check_png(const char *path, const struct image *image, float scale, struct error *err);

/* exif.c: reads what image_info holds out of a TIFF-structured EXIF block ("II*\0..." or
 * "MM\0*..."). Best effort: what is absent, damaged or out of range keeps its value. */
void image_parse_exif(const uint8_t *data, size_t size, struct image_info *info);

#endif
