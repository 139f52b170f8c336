/* tiff.c -- reads TIFF pictures by libtiff (TIFF 6.0; its tiffio.h): the first directory that is no thumbnail.
 *
 * Integers are sRGB unless a profile says otherwise; floats are linear light unless a profile has a curve. Camera raw
 * files are TIFF, too, and are told from pictures by their directories. Damage is an error, never a grey block: so is
 * a warning that the library gives while it decodes. */
#include "common/tiff.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/color_icc.h"
#include "common/image_ceiling.h"
#include "common/image_foreign.h"
#include "common/mem.h"

/* Largest allocation of the library: of one compressed strip or tile, or a tag. */
#define MAX_ALLOCATION ((tmsize_t)1 << 31)
/* LZMA and Zstandard compress a picture of one colour to nothing; a photograph has noise. Bounds the memory that a
 * small file can ask for. */
#define MAX_PIXELS_PER_BYTE 16384
/* Directories that are looked at for one that is no thumbnail; and of a raw file. */
#define MAX_DIRECTORIES 16
#define PHOTOMETRIC_LINEAR_RAW 34892 /* DNG 1.4, chapter 4 */
/* Largest distance of a curve from y = x that is rounding. */
#define SAME_CURVE 1e-3f

/* --- the file ------------------------------------------------------------------------------ */

static tmsize_t read_bytes(thandle_t user, void *to, tmsize_t size) {
    struct tiff_reader *r = user;
    size_t got = size > 0 ? image_source_read(r->source, r->offset, to, (size_t)size) : 0;
    r->offset += got;
    return (tmsize_t)got;
}

static tmsize_t write_nothing(thandle_t user, void *from, tmsize_t size) {
    (void)user, (void)from, (void)size;
    return -1;
}

static toff_t seek(thandle_t user, toff_t offset, int whence) {
    struct tiff_reader *r = user;
    r->offset = whence == SEEK_SET ? offset : whence == SEEK_CUR ? r->offset + offset : r->source->size + offset;
    return r->offset;
}

static int close_nothing(thandle_t user) {
    (void)user;
    return 0;
}

static toff_t size_of(thandle_t user) { return ((struct tiff_reader *)user)->source->size; }

static void complain(struct tiff_reader *r, const char *format, va_list args) {
    if (r->complaint[0] != '\0')
        return;
    vsnprintf(r->complaint, sizeof r->complaint, format, args);
    for (char *c = r->complaint; *c; c++)
        *c = *c >= ' ' && *c <= '~' ? *c : '?';
}

static int on_error(TIFF *tiff, void *user, const char *module, const char *format, va_list args) {
    (void)tiff, (void)module;
    complain(user, format, args);
    return 1;
}

/* Unknown tags are usual. While pixels are decoded a warning says that some are missing. */
static int on_warning(TIFF *tiff, void *user, const char *module, const char *format, va_list args) {
    struct tiff_reader *r = user;
    (void)tiff, (void)module;
    if (r->is_decoding)
        complain(r, format, args);
    return 1;
}

static enum status start(struct tiff_reader *r, struct error *err) {
    TIFFOpenOptions *options = TIFFOpenOptionsAlloc();
    if (!options)
        mem_exhausted("libtiff");
    TIFFOpenOptionsSetMaxSingleMemAlloc(options, MAX_ALLOCATION);
    TIFFOpenOptionsSetErrorHandlerExtR(options, on_error, r);
    TIFFOpenOptionsSetWarningHandlerExtR(options, on_warning, r);
    r->tiff = TIFFClientOpenExt(r->source->name, "rm", r, read_bytes, write_nothing, seek, close_nothing, size_of, NULL,
                                NULL, options);
    TIFFOpenOptionsFree(options);
    return r->tiff ? STATUS_OK : tiff_refuse(r, "it has no directory", err);
}

/* --- directories --------------------------------------------------------------------------- */

static bool has_raw_pixels(TIFF *tiff) {
    uint16_t photometric = 0;
    uint8_t *version = NULL;
    return TIFFGetField(tiff, TIFFTAG_DNGVERSION, &version) ||
           (TIFFGetField(tiff, TIFFTAG_PHOTOMETRIC, &photometric) &&
            (photometric == PHOTOMETRIC_CFA || photometric == PHOTOMETRIC_LINEAR_RAW));
}

/* Whether the first directory or one below it holds the sensor's values. */
static bool is_raw(TIFF *tiff) {
    uint16_t count = 0;
    uint64_t *offsets = NULL, kept[MAX_DIRECTORIES];
    bool found = has_raw_pixels(tiff);
    if (!found && TIFFGetField(tiff, TIFFTAG_SUBIFD, &count, &offsets) && offsets) {
        count = count < MAX_DIRECTORIES ? count : MAX_DIRECTORIES;
        memcpy(kept, offsets, count * sizeof *kept); /* the library's go with the directory */
        for (uint16_t i = 0; i < count && !found; i++)
            found = TIFFSetSubDirectory(tiff, kept[i]) && has_raw_pixels(tiff);
        TIFFSetDirectory(tiff, 0);
    }
    return found;
}

/* The first that is no thumbnail, else the first. */
static bool choose_directory(TIFF *tiff) {
    for (tdir_t i = 0; i < MAX_DIRECTORIES && TIFFSetDirectory(tiff, i); i++) {
        uint32_t kind = 0;
        TIFFGetFieldDefaulted(tiff, TIFFTAG_SUBFILETYPE, &kind);
        if (!(kind & FILETYPE_REDUCEDIMAGE))
            return true;
    }
    return TIFFSetDirectory(tiff, 0) != 0;
}

/* The camera's settings; the current directory is read again after them. */
static void read_exif(struct tiff_reader *r, struct image_info *info) {
    uint64_t place = 0;
    uint16_t iso_count = 0, *iso = NULL, space = 0;
    float time_sec = 0.0f, f_number = 0.0f;
    tdir_t directory = TIFFCurrentDirectory(r->tiff);
    if (!TIFFGetField(r->tiff, TIFFTAG_EXIFIFD, &place))
        return;
    if (TIFFReadEXIFDirectory(r->tiff, place)) {
        if (TIFFGetField(r->tiff, EXIFTAG_EXPOSURETIME, &time_sec) && time_sec > 0.0f)
            info->exposure_time_sec = (double)time_sec;
        if (TIFFGetField(r->tiff, EXIFTAG_FNUMBER, &f_number) && f_number > 0.0f)
            info->f_number = (double)f_number;
        if (TIFFGetField(r->tiff, EXIFTAG_ISOSPEEDRATINGS, &iso_count, &iso) && iso_count > 0 && iso)
            info->iso = iso[0];
        if (TIFFGetField(r->tiff, EXIFTAG_COLORSPACE, &space)) {
            info->is_uncalibrated = space == 65535;
            info->is_adobe_rgb = space == 2;
        }
    }
    r->complaint[0] = '\0'; /* a damaged EXIF is none */
    TIFFSetDirectory(r->tiff, directory);
}

/* --- kinds of pixels ----------------------------------------------------------------------- */

static void find_alpha(struct tiff_reader *r) {
    uint16_t count = 0, *kind = NULL;
    TIFFGetFieldDefaulted(r->tiff, TIFFTAG_EXTRASAMPLES, &count, &kind);
    if (count == 0 || !kind || r->color == TIFF_INKS || r->sample_count != r->color + count)
        return;
    r->has_alpha = kind[0] == EXTRASAMPLE_ASSOCALPHA || kind[0] == EXTRASAMPLE_UNASSALPHA;
    r->is_premultiplied = kind[0] == EXTRASAMPLE_ASSOCALPHA;
}

static bool is_known_sample(const struct tiff_reader *r) {
    return r->format == SAMPLEFORMAT_IEEEFP
               ? r->bits == 16 || r->bits == 32 || r->bits == 64
               : r->format == SAMPLEFORMAT_UINT && (r->bits == 8 || r->bits == 16 || r->bits == 32);
}

/* Colours and samples of the current directory. */
static void find_kind(struct tiff_reader *r) {
    TIFFGetField(r->tiff, TIFFTAG_IMAGEWIDTH, &r->width);
    TIFFGetField(r->tiff, TIFFTAG_IMAGELENGTH, &r->height);
    TIFFGetFieldDefaulted(r->tiff, TIFFTAG_BITSPERSAMPLE, &r->bits);
    TIFFGetFieldDefaulted(r->tiff, TIFFTAG_SAMPLEFORMAT, &r->format);
    TIFFGetFieldDefaulted(r->tiff, TIFFTAG_SAMPLESPERPIXEL, &r->sample_count);
    TIFFGetFieldDefaulted(r->tiff, TIFFTAG_PLANARCONFIG, &r->planar);
    TIFFGetFieldDefaulted(r->tiff, TIFFTAG_COMPRESSION, &r->compression);
    TIFFGetField(r->tiff, TIFFTAG_PHOTOMETRIC, &r->photometric);
    uint16_t photometric = r->photometric;
    r->format = r->format == SAMPLEFORMAT_VOID ? SAMPLEFORMAT_UINT : r->format;
    if (photometric == PHOTOMETRIC_YCBCR && r->compression == COMPRESSION_JPEG && r->planar == PLANARCONFIG_CONTIG &&
        TIFFSetField(r->tiff, TIFFTAG_JPEGCOLORMODE, JPEGCOLORMODE_RGB))
        photometric = PHOTOMETRIC_RGB; /* the library converts */
    r->color = photometric == PHOTOMETRIC_RGB ? TIFF_RGB : photometric == PHOTOMETRIC_SEPARATED ? TIFF_INKS : TIFF_GREY;
    r->is_simple =
        is_known_sample(r) && r->sample_count >= (uint16_t)r->color &&
        (r->color != TIFF_GREY || photometric == PHOTOMETRIC_MINISBLACK || photometric == PHOTOMETRIC_MINISWHITE);
    find_alpha(r);
}

static enum status check_kind(const struct tiff_reader *r, struct error *err) {
    char why[1024] = "";
    if (r->photometric == PHOTOMETRIC_LOGL || r->photometric == PHOTOMETRIC_LOGLUV) {
        error_set(err, STATUS_INPUT, "%s: a TIFF of LogLuv pixels is not read", r->source->name);
        return error_hint(err, "save it as EXR, Radiance HDR or a TIFF of 32-bit floats");
    }
    if (r->is_simple || (r->format == SAMPLEFORMAT_UINT && r->bits <= 8 && TIFFRGBAImageOK(r->tiff, why)))
        return STATUS_OK;
    error_set(err, STATUS_INPUT,
              "%s: a TIFF of %d samples of %d bits (photometric interpretation %d, sample format %d) is not read",
              r->source->name, r->sample_count, r->bits, r->photometric, r->format);
    return error_hint(err, "save it in RGB with 8 or 16 bits, or as 32-bit floats");
}

/* The size of the picture and its channels. */
static enum status read_header(struct tiff_reader *r, struct image *image, struct image_info *info, struct error *err) {
    if (image_is_raw_name(r->source->name) || is_raw(r->tiff))
        return image_refuse_raw(r->source->name, err);
    if (!choose_directory(r->tiff))
        return tiff_refuse(r, "its directory cannot be read", err);
    uint16_t orientation = ORIENTATION_TOPLEFT;
    TIFFGetFieldDefaulted(r->tiff, TIFFTAG_ORIENTATION, &orientation);
    read_exif(r, info);
    find_kind(r);
    enum status status = check_kind(r, err);
    uint32_t channel_count = r->has_alpha || r->color == TIFF_INKS ? 4 : 3;
    if (status == STATUS_OK)
        status = image_header(image, r->source->name, r->width, r->height, channel_count, image_rgba, err);
    if (status != STATUS_OK)
        return status;
    if ((uint64_t)r->width * r->height / MAX_PIXELS_PER_BYTE > r->source->size)
        return tiff_refuse(r, "the file is too short for its picture's size", err);
    info->orientation = orientation >= 1 && orientation <= 8 ? orientation : 1;
    info->encoding = r->is_simple && r->format == SAMPLEFORMAT_IEEEFP ? IMAGE_LINEAR : IMAGE_SRGB;
    info->bits = r->is_simple && r->bits > 8 ? (r->bits > 16 ? 32 : 16) : 8;
    return STATUS_OK;
}

/* --- colours ------------------------------------------------------------------------------- */

static bool is_linear(const struct color *color) {
    float off = 0.0f;
    size_t last = color->step_count - 1;
    for (size_t c = 0; c < 3 && color->curve; c++)
        for (size_t i = 0; i <= last; i++)
            off = fmaxf(off, fabsf(color->curve[c * color->step_count + i] - (float)i / (float)last));
    return color->curve && off < SAME_CURVE;
}

/* Floats under a profile of linear light may exceed 1, which image_convert would cut. */
static void convert_linear(struct image *image, struct image_info *info, struct color *color) {
    memcpy(info->color_space, color->name, sizeof info->color_space);
    color_multiply(color->matrix, image_ceiling(info), image->pixel, image->channel_count,
                   (size_t)image->width * image->height, &info->outside_count);
    color_release(color);
}

static void convert_inks(struct image *image, struct image_info *info, const void *profile, size_t size) {
    struct color_inks *inks = color_inks_new(profile, size, info->color_warning);
    size_t count = (size_t)image->width * image->height;
    for (size_t i = 0; i < count; i++) {
        float *pixel = image->pixel + 4 * i, rgb[3];
        color_inks_convert(inks, pixel, rgb, 1);
        memcpy(pixel, rgb, sizeof rgb);
        pixel[3] = 1.0f;
    }
    color_inks_free(inks);
}

static void convert(struct tiff_reader *r, struct image *image, struct image_info *info) {
    uint32_t size = 0;
    void *profile = NULL;
    struct color color;
    if (!TIFFGetField(r->tiff, TIFFTAG_ICCPROFILE, &size, &profile) || !profile)
        size = 0;
    if (r->is_simple && r->color == TIFF_INKS) {
        convert_inks(image, info, profile, size);
        return;
    }
    color_init(&color);
    if (size > 0)
        color_set_profile(&color, profile, size, r->color == TIFF_GREY, info->bits);
    else if (info->encoding == IMAGE_SRGB) {
        /* Developers of raw files write linear light so, and its only sign is a profile, where there is one. */
        if (info->bits == 16)
            snprintf(color.warning, sizeof color.warning, "it is a TIFF of 16 bits without a colour profile");
        image_color_by_exif(info, &color);
    }
    if (info->encoding == IMAGE_LINEAR && (size == 0 || color.warning[0]))
        memcpy(info->color_warning, color.warning, sizeof info->color_warning);
    else if (info->encoding == IMAGE_LINEAR && is_linear(&color))
        convert_linear(image, info, &color);
    else {
        info->encoding = IMAGE_SRGB;
        image_convert(image, info, &color);
    }
    color_release(&color);
}

enum status image_read_tiff(struct image_source *source, bool probe, struct image *image, struct image_info *info,
                            struct error *err) {
    struct tiff_reader r = {.source = source};
    enum status status = start(&r, err);
    if (status == STATUS_OK)
        status = read_header(&r, image, info, err);
    if (status == STATUS_OK && !probe)
        status = tiff_read_pixels(&r, image, err);
    if (status == STATUS_OK && !probe && !source->as_stored)
        convert(&r, image, info);
    if (r.tiff)
        TIFFClose(r.tiff);
    return status;
}

/* "LIBTIFF, Version 4.5.0", and lines on whose it is. */
void image_tiff_version(char text[IMAGE_VERSION_SIZE]) {
    const char *said = TIFFGetVersion();
    said += strcspn(said, "0123456789");
    snprintf(text, IMAGE_VERSION_SIZE, "%.*s", (int)strcspn(said, "\n"), said);
}
