/* test_tiff.c -- the TIFF reader. */
#include <tiffio.h>

#include "tests/fuzz/picture.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size >= 4 && (memcmp(data, "II", 2) == 0 || memcmp(data, "MM", 2) == 0))
        picture_read(data, size);
    return 0;
}

struct kind {
    const char *mode;
    uint16_t bits, format, samples, photometric, planar, compression;
    uint32_t tile; /* 0: strips */
};

static void add(struct seeds *s, const struct kind *k) {
    static uint8_t block[64 * 64 * 4 * 4];
    char path[256];
    snprintf(path, sizeof path, "%s/picture", fuzz_folder());
    for (size_t i = 0; i < sizeof block; i++)
        block[i] = (uint8_t)(i / 5);
    TIFF *tiff = TIFFOpen(path, k->mode);
    MUST(tiff);
    TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, 40);
    TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, 30);
    TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, k->bits);
    TIFFSetField(tiff, TIFFTAG_SAMPLEFORMAT, k->format);
    TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, k->samples);
    TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, k->photometric);
    TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, k->planar);
    TIFFSetField(tiff, TIFFTAG_COMPRESSION, k->compression);
    if (k->tile) {
        TIFFSetField(tiff, TIFFTAG_TILEWIDTH, k->tile);
        TIFFSetField(tiff, TIFFTAG_TILELENGTH, k->tile);
    } else {
        TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, 16);
    }
    uint32_t count = k->tile ? TIFFNumberOfTiles(tiff) : TIFFNumberOfStrips(tiff);
    for (uint32_t i = 0; i < count; i++)
        MUST((k->tile ? TIFFWriteEncodedTile(tiff, i, block, TIFFTileSize(tiff))
                      : TIFFWriteEncodedStrip(tiff, i, block, TIFFVStripSize(tiff, i + 1 < count ? 16 : 14))) > 0);
    TIFFClose(tiff);
    seeds_path(s, path, "");
}

void fuzz_seeds(struct seeds *s) {
    static const uint16_t uint = SAMPLEFORMAT_UINT, ieee = SAMPLEFORMAT_IEEEFP, whole = PLANARCONFIG_CONTIG,
                          apart = PLANARCONFIG_SEPARATE;
    const struct kind kinds[] = {
        {"w", 8, uint, 3, PHOTOMETRIC_RGB, whole, COMPRESSION_LZW, 0},
        {"wb", 16, uint, 4, PHOTOMETRIC_RGB, apart, COMPRESSION_ADOBE_DEFLATE, 16},
        {"w8", 32, ieee, 3, PHOTOMETRIC_RGB, whole, COMPRESSION_NONE, 0},
        {"w", 8, uint, 3, PHOTOMETRIC_YCBCR, whole, COMPRESSION_JPEG, 16},
        {"w", 8, uint, 4, PHOTOMETRIC_SEPARATED, whole, COMPRESSION_PACKBITS, 0},
        {"w", 1, uint, 1, PHOTOMETRIC_MINISWHITE, whole, COMPRESSION_CCITTFAX4, 0},
    };
    s->mutants = 4000;
    TIFFSetWarningHandler(NULL);
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++)
        add(s, &kinds[i]);
}
