/* tiff.h -- state of reading a TIFF file, and what tiff_pixels.c does with it for tiff.c, which opens the file and
 * reads what it says of itself; private to the codec. */
#ifndef UNBAKE_COMMON_TIFF_H
#define UNBAKE_COMMON_TIFF_H

#include <tiffio.h>

#include "common/image_codec.h"

/* Kind of colour in the samples. */
enum tiff_color { TIFF_GREY = 1, TIFF_RGB = 3, TIFF_INKS = 4 };

struct tiff_reader {
    struct image_source *source;
    uint64_t offset;
    TIFF *tiff;
    bool is_decoding;    /* a warning now concerns pixels */
    char complaint[200]; /* the library's first error, or warning while decoding; "" */
    uint32_t width, height;
    uint16_t bits, format, photometric, planar, compression;
    uint16_t sample_count; /* a pixel */
    enum tiff_color color;
    bool is_simple;        /* samples are taken as stored; else TIFFRGBAImage converts them to 8 bits */
    bool has_alpha;        /* the sample after the colours */
    bool is_premultiplied; /* by alpha */
};

/* STATUS_INPUT: the library's complaint, or `why`. */
enum status tiff_refuse(const struct tiff_reader *r, const char *why, struct error *err);

/* Reads the current directory into *image, which has its size and channels: floats as stored, integers in [0, 1];
 * grey becomes R = G = B; inks stay C, M, Y, K in four channels. */
enum status tiff_read_pixels(struct tiff_reader *r, struct image *image, struct error *err);

#endif
