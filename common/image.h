/* image.h -- pictures in memory and the files they come from and go to.
 *
 * Pixels are float, interleaved, top row first. Readers accept what an uploaded bundle may
 * hold, so every size is capped (IMAGE_MAX_SIDE, IMAGE_MAX_PIXELS) before memory is asked
 * for, and damage is STATUS_INPUT with a sentence, never a crash. Thread-safe: no shared
 * state. Each library has its file: exr_*.c OpenEXRCore, png_*.c libpng, jpeg.c libjpeg, heif.c libheif,
 * tiff*.c libtiff, webp.c libwebp. */
#ifndef UNBAKE_COMMON_IMAGE_H
#define UNBAKE_COMMON_IMAGE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "common/error.h"
#include "common/parallel.h"

#define IMAGE_MAX_SIDE 65536               /* pixels, along either side */
#define IMAGE_MAX_PIXELS ((size_t)1 << 29) /* 8 GiB as floats of four channels */
#define IMAGE_MAX_CHANNELS 64 /* of a picture in memory; layers of an EXR that are not wanted do not count */

/* What image_read reads, for messages. */
#define IMAGE_FORMATS "EXR, PNG, JPEG, TIFF, HEIC, AVIF, WebP or Radiance HDR"

struct image {
    uint32_t width, height;
    uint32_t channel_count;
    char (*channel)[64]; /* [channel_count] names, "R" "G" "B" "A" "base_color.R"; owned */
    float *pixel;        /* [height][width][channel_count]; owned */
    uint8_t *clipped;    /* [height][width] bit c: channel c has its largest value in the file (IMAGE_CLIP_SHARE);
                          * only for IMAGE_CONVERTED, else NULL; owned */
};

/* Code value, as a share of the maximum, from which a channel of an ordinary photograph counts as clipped. Clipped
 * surfaces are 255 in the camera, but JPEG quantisation and resizing (often done before poses are computed) lower
 * them by a few levels. Unclipped values above 250 are within 5 % of the clip in linear light, so treating them as
 * bounds loses little. */
#define IMAGE_CLIP_SHARE (250.0f / 255.0f)

/* Relation of pixel values to linear light. */
enum image_encoding {
    IMAGE_LINEAR,   /* EXR, Radiance, TIFF of floats: linear light, unbounded */
    IMAGE_SRGB,     /* others: as stored, in [0, 1]; linear only after image_srgb_to_linear */
    IMAGE_CONVERTED /* others of another colour space: converted to linear light; image.clipped marks lower bounds */
};

/* Pixels from (x, y). */
struct image_window {
    uint32_t x, y, width, height;
};

struct image_info {
    enum image_encoding encoding;
    int bits; /* per channel as stored: 8, 16, 32 */
    /* From EXIF where present, else 0. */
    double exposure_time_sec, iso, f_number;
    int orientation; /* EXIF orientation 1..8, 1 when absent; the reader does NOT rotate. HEIC and AVIF: 1, since
                           * their rotation is part of the picture and has been applied */
    /* EXR only, else 0: the part of the picture that the file has pixels of, and the size of its data window, which
     * some libraries (OpenCV, imageio) take for the picture. */
    struct image_window window;
    uint32_t stored_width, stored_height;
    bool is_adobe_rgb;    /* EXIF says so; cameras without profile do that */
    bool is_uncalibrated; /* EXIF says that the colour space is not sRGB, without naming it */
    /* Set by reading, not by probing: */
    char color_space[64];    /* converted from, for people: "Display P3"; "" if not converted */
    char color_warning[160]; /* why the file's colour information is not used and sRGB is assumed; or "" */
    size_t outside_count;    /* pixels outside of Rec. 709: a channel is negative */
    float clip;              /* IMAGE_CONVERTED: the smallest channel of IMAGE_CLIP_SHARE after conversion */
};

void image_init(struct image *image, uint32_t width, uint32_t height, uint32_t channel_count,
                const char *const *channel);                               /* zero pixels; names are copied */
void image_init_rgb(struct image *image, uint32_t width, uint32_t height); /* channels R G B */
/* The first three channels of `from`, which must be R G B, as a new picture. */
void image_take_rgb(const struct image *from, struct image *image);
void image_copy(const struct image *from, struct image *image); /* all but clipped */
void image_release(struct image *image);

/* Turns a picture as EXIF's orientation (1 to 8; others: not) says. */
void image_orient(struct image *image, int orientation);
/* Whether the upright picture is as wide as the stored one is high. */
static inline bool image_orientation_swaps(int orientation) { return orientation >= 5 && orientation <= 8; }

/* First half of image_init, for sizes from a file: sets size and channel names, without pixels; STATUS_LIMIT when a
 * limit is exceeded, STATUS_INPUT when a size is 0. `name` is for messages. */
enum status image_header(struct image *image, const char *name, uint64_t width, uint64_t height, uint32_t channel_count,
                         const char *const *channel, struct error *err);

/* Second half: zero pixels. */
void image_allocate(struct image *image);

/* Index of a channel by its exact name; -1 when absent. */
int image_channel(const struct image *image, const char *name);

/* Reads EXR, PNG, JPEG, TIFF, HEIC, AVIF, WebP or Radiance HDR by content (not by extension). Channels are in the order
 * R, G, B, A if they exist, then the others by name; grey PNG/JPEG, and Y of an EXR without R, G, B, become R = G = B.
 * An EXR's picture is its display window, to which cameras refer: pixels outside of the data window are 0; of several
 * parts the first with R, G, B is read. info may be NULL. On error *image is empty (releasing it does no harm).
 *
 * Colours are linear or sRGB of Rec. 709's primaries and white D65. Files that specify others (ICC profile; PNG's
 * cICP, cHRM and gAMA; HEIF's nclx; EXIF for Adobe RGB; EXR's chromaticities) are converted to linear light of these;
 * colour information that cannot be used gives a warning in info. */
enum status image_read(const char *path, struct image *image, struct image_info *info, struct error *err);

/* The same with stored values of PNG, JPEG and others, without colour conversion: for masks. */
enum status image_read_stored(const char *path, struct image *image, struct error *err);

/* The same of a photograph: only R, G, B and, if there, A. Of an EXR's layers the one that is the picture, as Blender
 * and other renderers name it ("ViewLayer.Combined.R"; "r", "g", "b"); STATUS_INPUT where several may be, or none. */
enum status image_read_photograph(const char *path, struct image *image, struct image_info *info, struct error *err);

/* The same from memory; `name` stands for the path in messages. */
enum status image_read_memory(const char *name, const void *data, size_t size, struct image *image,
                              struct image_info *info, struct error *err);

/* As image_read_stored, from memory. */
enum status image_read_memory_stored(const char *name, const void *data, size_t size, struct image *image,
                                     struct error *err);

/* image_read, and image_read_photograph, without reading pixels: only width, height, channels and info; pixel is
 * NULL. */
enum status image_probe(const char *path, struct image *image, struct image_info *info, struct error *err);
enum status image_probe_photograph(const char *path, struct image *image, struct image_info *info, struct error *err);

/* Whether cameras give their raw files, many of which are TIFF, such a name. image_read refuses them. */
bool image_is_raw_name(const char *name);

/* Versions of the codecs' libraries, as they say themselves: "1.6.39". libjpeg-turbo does not: that of its headers. */
#define IMAGE_VERSION_SIZE 24
const char *image_png_version(void);
const char *image_jpeg_version(void);
const char *image_zlib_version(void);
const char *image_heif_version(void);
void image_exr_version(char text[IMAGE_VERSION_SIZE]);
void image_tiff_version(char text[IMAGE_VERSION_SIZE]);
void image_webp_version(char text[IMAGE_VERSION_SIZE]);
/* Which decoder libheif was installed without, as a sentence, or NULL (its decoders are packages of their own since
 * Debian 13). */
const char *image_heif_lacks(void);

enum image_exr_type { IMAGE_HALF, IMAGE_FLOAT };

/* Both writers read the file back and compare it with the picture; STATUS_CORRUPT says what a reader would find
 * instead.
 *
 * Writes an EXR (ZIP, 16-line scanline blocks, or 64 x 64 tiles when `tiled`) with these channels; the same pixels
 * give the same bytes. Overwrites `path` in place: callers that need atomicity write a temporary name. */
enum status image_write_exr(const char *path, const struct image *image, enum image_exr_type type, bool tiled,
                            struct error *err);

/* A line of text in an EXR's header. */
struct image_note {
    const char *name, *text; /* UTF-8 */
};
/* The same with attributes note[count] of type string, compressed by the threads of a pool; NULL: by the caller's. */
enum status image_write_exr_noted(const char *path, const struct image *image, enum image_exr_type type, bool tiled,
                                  const struct image_note *note, size_t note_count, struct parallel *pool,
                                  struct error *err);

/* Writes an 8-bit sRGB PNG of the first three channels (or the one there is, as grey), values
 * times `scale`, clamped to [0, 1], converted from linear. Non-finite values become magenta. */
enum status image_write_png(const char *path, const struct image *image, float scale, struct error *err);

/* The sRGB transfer function (IEC 61966-2-1), value by value. */
float image_srgb_to_linear(float value);
float image_linear_to_srgb(float value);

/* IEEE 754 half precision, round to nearest even; overflow becomes infinity. */
uint16_t image_half_from_float(float value);
/* Without a branch, for loops that the compiler vectorises. In integers but for one product of
 * normal numbers, so that a thread which flushes subnormals to zero reads the same. */
static inline float image_float_from_half(uint16_t half) {
    uint32_t exponent = half & 0x7c00, mantissa = half & 0x3ff;
    float small = (float)(int32_t)mantissa * 0x1p-24f, value;
    uint32_t small_bits, bits = (uint32_t)(half & 0x7fff) << 13;
    memcpy(&small_bits, &small, sizeof small_bits);
    bits += exponent == 0x7c00 ? 224u << 23 : 112u << 23;
    bits = (exponent == 0 ? small_bits : bits) | (uint32_t)(half & 0x8000) << 16;
    memcpy(&value, &bits, sizeof value);
    return value;
}

#endif
