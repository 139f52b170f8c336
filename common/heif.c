/* heif.c -- reads HEIC and AVIF pictures by libheif (its heif.h; ISO/IEC 23008-12), the primary image of the file.
 *
 * Rotation, mirroring and cropping (irot, imir, clap) are part of the picture in this container, unlike the orientation
 * in EXIF, which it tells readers to ignore: the picture is the one that every viewer shows, and its orientation is 1.
 * Gain maps, depth and other auxiliary images are not read. PQ and HLG are converted as those of PNG (color.h).
 *
 * Tiles are decoded in this thread: photographs are read in parallel already. libheif 1.16 and later opens its decoders
 * by dlopen, within the system's library folders, which the worker's sandbox leaves readable. */
#include <string.h>

#include <libheif/heif.h>

#include "common/color_cicp.h"
#include "common/color_icc.h"
#include "common/heif_items.h"
#include "common/image_codec.h"
#include "common/mem.h"

/* A picture of one colour has 10,169 pixels a byte as AVIF (12 MP, libaom) and 1,546 as HEIC (x265); a photograph has
 * noise. Bounds the memory that a small file can ask for. */
#define MAX_PIXELS_PER_BYTE 16384
/* Side of a square of IMAGE_MAX_PIXELS, rounded down: as libheif wants its limit. Grids may be as large in all. */
#define LIMIT_SIDE 23170
/* Bytes of the largest ICC profile and EXIF block that are looked at. */
#define PROFILE_MAX ((size_t)16 << 20)
#define EXIF_MAX ((size_t)1 << 20) /* bytes of a block of EXIF */

struct heif_picture {
    struct image_source *source;
    int64_t position;
    struct heif_context *context;
    struct heif_image_handle *handle;
    struct heif_image *decoded;
    int bits;
    bool has_alpha;
};

/* --- the file ------------------------------------------------------------------------------ */

static int64_t get_position(void *user) { return ((struct heif_picture *)user)->position; }

static int read_bytes(void *data, size_t size, void *user) {
    struct heif_picture *p = user;
    size_t got = image_source_read(p->source, (uint64_t)p->position, data, size);
    p->position += (int64_t)got;
    return got == size ? 0 : -1;
}

static int seek(int64_t position, void *user) {
    ((struct heif_picture *)user)->position = position;
    return position < 0 ? -1 : 0;
}

static enum heif_reader_grow_status wait_for_size(int64_t target, void *user) {
    const struct heif_picture *p = user;
    return target >= 0 && (uint64_t)target <= p->source->size ? heif_reader_grow_status_size_reached
                                                              : heif_reader_grow_status_size_beyond_eof;
}

static const struct heif_reader reader = {
    .reader_api_version = 1,
    .get_position = get_position,
    .read = read_bytes,
    .seek = seek,
    .wait_for_file_size = wait_for_size,
};

static enum status refuse(const struct heif_picture *p, struct heif_error what, struct error *err) {
    const char *name = p->source->name, *text = what.message ? what.message : "";
    if (what.code == heif_error_Memory_allocation_error && what.subcode == heif_suberror_Security_limit_exceeded)
        return error_set(err, STATUS_LIMIT, "%s: the HEIF picture exceeds a limit: %s", name, text);
    if (what.code == heif_error_Memory_allocation_error)
        mem_exhausted("libheif");
    if (what.code == heif_error_Unsupported_feature || what.code == heif_error_Unsupported_filetype ||
        what.code == heif_error_Plugin_loading_error) {
        error_set(err, STATUS_INPUT, "%s: this HEIF picture cannot be decoded: %s", name, text);
        return error_hint(err, "save it as PNG, TIFF or JPEG, with its colour profile");
    }
    return error_set(err, STATUS_INPUT, "%s: damaged HEIF: %s", name, text);
}

/* --- what it says of itself ---------------------------------------------------------------- */

/* Exposure and such; the first block named "Exif", which begins with the offset of the TIFF header in what follows. */
static void read_exif(const struct heif_picture *p, struct image_info *info) {
    heif_item_id id;
    if (heif_image_handle_get_list_of_metadata_block_IDs(p->handle, "Exif", &id, 1) < 1)
        return;
    size_t size = heif_image_handle_get_metadata_size(p->handle, id);
    if (size < 4 || size > EXIF_MAX)
        return;
    uint8_t *data = mem_alloc(size);
    struct heif_error result = heif_image_handle_get_metadata(p->handle, id, data);
    size_t at = (size_t)data[0] << 24 | (size_t)data[1] << 16 | (size_t)data[2] << 8 | data[3];
    if (result.code == heif_error_Ok && at < size - 4)
        image_parse_exif(data + 4 + at, size - 4 - at, info);
    info->orientation = 1;
    mem_free(data);
}

static bool use_profile(const struct heif_picture *p, struct color *color) {
    size_t size = heif_image_handle_get_raw_color_profile_size(p->handle);
    if (size == 0 || size > PROFILE_MAX)
        return false;
    uint8_t *profile = mem_alloc(size);
    if (heif_image_handle_get_raw_color_profile(p->handle, profile).code == heif_error_Ok)
        color_set_profile(color, profile, size, false, p->bits);
    mem_free(profile);
    return true;
}

/* Primaries and transfer of the file or, where it is silent, of the bitstream; 2 is "unspecified". */
static void use_nclx(const struct heif_picture *p, const struct image_info *info, struct color *color) {
    struct heif_color_profile_nclx *nclx = NULL;
    uint8_t number[4] = {2, 2, 0, 1};
    if (heif_image_handle_get_nclx_color_profile(p->handle, &nclx).code != heif_error_Ok || !nclx)
        heif_image_get_nclx_color_profile(p->decoded, &nclx);
    if (nclx) {
        number[0] = (uint8_t)nclx->color_primaries;
        number[1] = (uint8_t)nclx->transfer_characteristics;
        heif_nclx_color_profile_free(nclx);
    }
    if (number[0] == 2 && number[1] == 2) {
        image_color_by_exif(info, color);
        return;
    }
    number[0] = number[0] == 2 ? 1 : number[0];  /* Rec. 709 */
    number[1] = number[1] == 2 ? 13 : number[1]; /* sRGB */
    color_set_cicp(color, "its colr box", number, p->bits);
}

/* --- pixels -------------------------------------------------------------------------------- */

static enum status read_header(struct heif_picture *p, struct image *image, struct image_info *info,
                               struct error *err) {
    const char *fault = heif_items_fault(p->source);
    if (fault)
        return error_set(err, STATUS_INPUT, "%s: damaged HEIF: %s", p->source->name, fault);
    p->context = heif_context_alloc();
    if (!p->context)
        mem_exhausted("libheif");
    heif_context_set_maximum_image_size_limit(p->context, LIMIT_SIDE);
    heif_context_set_max_decoding_threads(p->context, 0);
    struct heif_error result = heif_context_read_from_reader(p->context, &reader, p, NULL);
    if (result.code == heif_error_Ok)
        result = heif_context_get_primary_image_handle(p->context, &p->handle);
    if (result.code != heif_error_Ok)
        return refuse(p, result, err);
    int width = heif_image_handle_get_width(p->handle), height = heif_image_handle_get_height(p->handle);
    int bits = heif_image_handle_get_luma_bits_per_pixel(p->handle);
    p->has_alpha = heif_image_handle_has_alpha_channel(p->handle) != 0;
    enum status status = image_header(image, p->source->name, width < 0 ? 0 : (uint64_t)width,
                                      height < 0 ? 0 : (uint64_t)height, p->has_alpha ? 4 : 3, image_rgba, err);
    if (status != STATUS_OK)
        return status;
    if ((uint64_t)width * (uint64_t)height / MAX_PIXELS_PER_BYTE > p->source->size)
        return error_set(err, STATUS_INPUT, "%s: damaged HEIF: the file is too short for its picture's size",
                         p->source->name);
    info->encoding = IMAGE_SRGB;
    info->bits = bits > 8 ? 16 : 8;
    read_exif(p, info);
    return STATUS_OK;
}

/* Whether it is an AVIF and libaom is there. The other decoder, dav1d, starts a thread a processor for each picture. */
static bool prefers_aom(struct image_source *source) {
    const struct heif_decoder_descriptor *decoder[16];
    char brand[4] = "";
    bool is_there = false;
    int count = heif_get_decoder_descriptors(heif_compression_AV1, decoder, 16);
    for (int i = 0; i < count && i < 16; i++)
        is_there = is_there || strcmp(heif_decoder_descriptor_get_id_name(decoder[i]), "aom") == 0;
    return is_there && image_source_read(source, 8, brand, 4) == 4 && memcmp(brand, "avif", 4) == 0;
}

static enum status decode(struct heif_picture *p, struct error *err) {
    struct heif_decoding_options *options = heif_decoding_options_alloc();
    if (!options)
        mem_exhausted("libheif");
    if (options->version >= 3)
        options->strict_decoding = 1;
    if (options->version >= 4 && prefers_aom(p->source))
        options->decoder_id = "aom";
    bool is_deep = heif_image_handle_get_luma_bits_per_pixel(p->handle) > 8;
    enum heif_chroma chroma =
        is_deep        ? (p->has_alpha ? heif_chroma_interleaved_RRGGBBAA_LE : heif_chroma_interleaved_RRGGBB_LE)
        : p->has_alpha ? heif_chroma_interleaved_RGBA
                       : heif_chroma_interleaved_RGB;
    struct heif_error result = heif_decode_image(p->handle, &p->decoded, heif_colorspace_RGB, chroma, options);
    heif_decoding_options_free(options);
    if (result.code != heif_error_Ok)
        return refuse(p, result, err);
    p->bits = heif_image_get_bits_per_pixel_range(p->decoded, heif_channel_interleaved);
    return STATUS_OK;
}

static void convert_row(const struct heif_picture *p, const uint8_t *from, float *to, size_t count) {
    float scale = 1.0f / (float)((1 << p->bits) - 1);
    if (p->bits <= 8)
        for (size_t i = 0; i < count; i++)
            to[i] = (float)from[i] * scale;
    else
        for (size_t i = 0; i < count; i++)
            to[i] = (float)(from[2 * i] | from[2 * i + 1] << 8) * scale;
}

static enum status read_pixels(struct heif_picture *p, struct image *image, struct error *err) {
    int stride = 0;
    const uint8_t *plane = heif_image_get_plane_readonly(p->decoded, heif_channel_interleaved, &stride);
    int width = heif_image_get_width(p->decoded, heif_channel_interleaved);
    int height = heif_image_get_height(p->decoded, heif_channel_interleaved);
    size_t row_floats = (size_t)image->width * image->channel_count;
    if (!plane || width < 0 || (uint32_t)width != image->width || height < 0 || (uint32_t)height != image->height ||
        p->bits < 1 || p->bits > 16 || stride < 0 || (size_t)stride < row_floats * (p->bits > 8 ? 2 : 1))
        return error_set(err, STATUS_INPUT, "%s: damaged HEIF: its picture is not of the size that the file promises",
                         p->source->name);
    image_allocate(image);
    for (size_t y = 0; y < image->height; y++)
        convert_row(p, plane + y * (size_t)stride, image->pixel + y * row_floats, row_floats);
    if (p->has_alpha && heif_image_handle_is_premultiplied_alpha(p->handle))
        image_divide_by_alpha(image, 1.0f);
    return STATUS_OK;
}

static void convert(const struct heif_picture *p, struct image *image, struct image_info *info) {
    struct color color;
    color_init(&color);
    if (!use_profile(p, &color))
        use_nclx(p, info, &color);
    image_convert(image, info, &color);
}

enum status image_read_heif(struct image_source *source, bool probe, struct image *image, struct image_info *info,
                            struct error *err) {
    struct heif_picture p = {.source = source};
    enum status status = read_header(&p, image, info, err);
    if (status == STATUS_OK && !probe)
        status = decode(&p, err);
    if (status == STATUS_OK && !probe)
        status = read_pixels(&p, image, err);
    if (status == STATUS_OK && !probe && !source->as_stored)
        convert(&p, image, info);
    heif_image_release(p.decoded);
    heif_image_handle_release(p.handle);
    if (p.context)
        heif_context_free(p.context);
    return status;
}

const char *image_heif_version(void) { return heif_get_version(); }

/* The context is what makes libheif look for its decoders. */
const char *image_heif_lacks(void) {
    struct heif_context *context = heif_context_alloc();
    bool has_hevc = heif_have_decoder_for_format(heif_compression_HEVC) != 0;
    bool has_av1 = heif_have_decoder_for_format(heif_compression_AV1) != 0;
    heif_context_free(context);
    return !has_hevc  ? "libheif has no decoder of HEVC (libheif-plugin-libde265): no .heic can be read"
           : !has_av1 ? "libheif has no decoder of AV1 (libheif-plugin-aomdec): no .avif can be read"
                      : NULL;
}
