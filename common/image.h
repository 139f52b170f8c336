/* image.h -- pictures in memory and the files they come from and go to.
 *
 * Pixels are float, interleaved, top row first. Readers accept what an uploaded bundle may
 * hold, so every size is capped (IMAGE_MAX_SIDE, IMAGE_MAX_PIXELS) before memory is asked
 * for, and damage is STATUS_INPUT with a sentence, never a crash. Thread-safe: no shared
 * state. exr_*.c are the only include of OpenEXRCore, png_*.c of libpng, jpeg.c of libjpeg. */
#ifndef UNBAKE_COMMON_IMAGE_H
#define UNBAKE_COMMON_IMAGE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "common/error.h"

#define IMAGE_MAX_SIDE 65536
#define IMAGE_MAX_PIXELS ((size_t)1 << 29)
#define IMAGE_MAX_CHANNELS 64

struct image {
    uint32_t width, height;
    uint32_t channel_count;
    char (*channel)[64]; /* [channel_count] names, "R" "G" "B" "A" "base_color.R"; owned */
    float *pixel;        /* [height][width][channel_count]; owned */
    uint8_t *clipped;    /* [height][width] bit c: channel c is at its largest as the file stores it (IMAGE_CLIP_SHARE);
                          * of IMAGE_CONVERTED pictures, else NULL; owned */
};

/* The code value (of 255) from which a channel of an ordinary photograph counts as clipped. A
 * clipped surface is 255 in the camera, but JPEG's quantisation and the resizing that poses are
 * often computed after leave it a few levels lower; 250 takes those in, and what it takes too
 * many is above 95 % of the clip in linear light, where the bound says nearly what the value
 * would. */
#define IMAGE_CLIP_SHARE (250.0f / 255.0f)

/* How the values of a file relate to linear light, as the reader found them. */
enum image_encoding {
    IMAGE_LINEAR,   /* EXR, Radiance: linear light, unbounded */
    IMAGE_SRGB,     /* PNG, JPEG: as stored, in [0, 1]; linear only after image_srgb_to_linear */
    IMAGE_CONVERTED /* PNG, JPEG of another colour space: linear light, converted; image.clipped says where it is bounded */
};

struct image_info {
    enum image_encoding encoding;
    int bits;              /* per channel as stored: 8, 16, 32 */
    /* From EXIF where present, else 0. */
    double exposure_time_sec, iso, f_number;
    int orientation;       /* EXIF orientation 1..8, 1 when absent; the reader does NOT rotate */
    bool is_adobe_rgb;     /* EXIF says so, as cameras do that write no profile */
    bool is_uncalibrated;  /* EXIF says that the colours are not those of sRGB, and not what they are */
    /* Of pictures that were read, not only probed: */
    char color_space[64];    /* that pixels were converted from to Rec. 709, for people: "Display P3"; "" where they were not */
    char color_warning[160]; /* what the file says of its colours and cannot be used, so that they pass for sRGB; or "" */
    size_t outside_count;    /* pixels of colours that Rec. 709 cannot show: a channel is below 0 */
    float clip;              /* of IMAGE_CONVERTED: what IMAGE_CLIP_SHARE in all channels became */
};

void image_init(struct image *image, uint32_t width, uint32_t height, uint32_t channel_count,
                const char *const *channel); /* zero pixels; names are copied */
void image_init_rgb(struct image *image, uint32_t width, uint32_t height); /* channels R G B */
/* The first three channels of `from`, which are R G B, as a new picture. */
void image_take_rgb(const struct image *from, struct image *image);
void image_release(struct image *image);

/* As image_init in two steps, for sizes that a file tells: sets size and channel names, without pixels;
 * STATUS_LIMIT when the sizes pass the limits, STATUS_INPUT when one is 0. `name` is for messages. */
enum status image_header(struct image *image, const char *name, uint64_t width, uint64_t height,
                         uint32_t channel_count, const char *const *channel, struct error *err);

/* Zero pixels for an image that has its header. */
void image_allocate(struct image *image);

/* Index of a channel by its exact name; -1 when absent. */
int image_channel(const struct image *image, const char *name);

/* Reads EXR, PNG, JPEG or Radiance HDR by content (not by extension). Channels come in the
 * order R, G, B, A first where they exist, then the rest by name; grey PNG/JPEG and an EXR
 * with Y in place of R, G, B become R = G = B. An EXR's picture is its display window, for
 * which cameras are given: what its data window leaves out is 0, what it adds is dropped; of
 * several parts the first with R, G, B is taken. info may be NULL. On error *image is empty
 * (releasing it does no harm).
 *
 * Colours are of Rec. 709's primaries and white D65. A file that says that its own are others (ICC profile; PNG's cICP,
 * cHRM and gAMA; EXIF for Adobe RGB; EXR's chromaticities) is converted to linear light of these; what cannot be used is
 * a warning in info. */
enum status image_read(const char *path, struct image *image, struct image_info *info,
                       struct error *err);

/* The same with a PNG's or JPEG's values as stored, whatever the file says of its colours: for masks. */
enum status image_read_stored(const char *path, struct image *image, struct error *err);

/* The same from memory; `name` stands for the path in messages. */
enum status image_read_memory(const char *name, const void *data, size_t size,
                              struct image *image, struct image_info *info, struct error *err);

/* The same without reading pixels: only width, height, channels and info; pixel is NULL. */
enum status image_probe(const char *path, struct image *image, struct image_info *info,
                        struct error *err);

enum image_exr_type { IMAGE_HALF, IMAGE_FLOAT };

/* Both writers read back what they have written, where it is a file, and compare it with the picture: STATUS_CORRUPT says
 * what a reader would find in its place.
 *
 * Writes an EXR (ZIP, 16-line scanline blocks, or 64 x 64 tiles when `tiled`) with these
 * channels; the same pixels give the same bytes. Overwrites `path` in place: callers that
 * need atomicity write a temporary name. */
enum status image_write_exr(const char *path, const struct image *image, enum image_exr_type type,
                            bool tiled, struct error *err);

/* Writes an 8-bit sRGB PNG of the first three channels (or the one there is, as grey), values
 * times `scale`, clamped to [0, 1], converted from linear. Non-finite values become magenta. */
enum status image_write_png(const char *path, const struct image *image, float scale,
                            struct error *err);

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
