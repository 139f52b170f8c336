/* webp.c -- reads WebP pictures by libwebp and libwebpdemux (RFC 9649; webp/decode.h, webp/demux.h).
 *
 * The library decodes from memory: the file, which is far smaller than its pixels, is loaded whole. */
#include <stdio.h>
#include <string.h>

#include <webp/decode.h>
#include <webp/demux.h>

#include "common/color_icc.h"
#include "common/image_codec.h"
#include "common/mem.h"

/* A picture has at most 16383 pixels a side: 268 MP, of which a lossless file takes at most 4 bytes each. */
#define FILE_MAX ((uint64_t)1 << 30)
/* Enough for the headers. */
#define HEADER_BYTES 4096
/* A picture of one colour has 561 pixels a byte (12 MP), more when lossless; a photograph has noise. Bounds the memory
 * that a small file can ask for. */
#define MAX_PIXELS_PER_BYTE 16384

static enum status refuse(const struct image_source *source, VP8StatusCode code, struct error *err) {
    if (code == VP8_STATUS_OUT_OF_MEMORY)
        mem_exhausted("libwebp");
    const char *why = code == VP8_STATUS_NOT_ENOUGH_DATA       ? "the file is cut short"
                      : code == VP8_STATUS_UNSUPPORTED_FEATURE ? "it has a feature that libwebp does not know"
                                                               : "its data are not valid";
    return error_set(err, STATUS_INPUT, "%s: damaged WebP: %s", source->name, why);
}

static enum status read_header(struct image_source *source, WebPBitstreamFeatures *features, struct image *image,
                               struct image_info *info, struct error *err) {
    uint8_t head[HEADER_BYTES];
    size_t got = image_source_read(source, 0, head, sizeof head);
    VP8StatusCode code = WebPGetFeatures(head, got, features);
    uint64_t riff =
        got >= 8 ? 8 + ((uint64_t)head[4] | (uint64_t)head[5] << 8 | (uint64_t)head[6] << 16 | (uint64_t)head[7] << 24)
                 : 0;
    if (code != VP8_STATUS_OK)
        return refuse(source, code, err);
    if (riff > source->size)
        return refuse(source, VP8_STATUS_NOT_ENOUGH_DATA, err);
    if (features->has_animation)
        return error_set(err, STATUS_INPUT, "%s: an animated WebP is not a photograph", source->name);
    uint64_t width = (uint64_t)features->width, height = (uint64_t)features->height;
    enum status status = image_header(image, source->name, width, height, features->has_alpha ? 4 : 3, image_rgba, err);
    if (status != STATUS_OK)
        return status;
    if (width * height / MAX_PIXELS_PER_BYTE > source->size)
        return error_set(err, STATUS_INPUT, "%s: damaged WebP: the file is too short for its picture's size",
                         source->name);
    if (source->size > FILE_MAX)
        return error_set(err, STATUS_LIMIT, "%s: a WebP of more than %llu bytes", source->name,
                         (unsigned long long)FILE_MAX);
    info->encoding = IMAGE_SRGB;
    info->bits = 8;
    return STATUS_OK;
}

/* EXIF begins with the TIFF header or, as some tools write it, with "Exif\0\0" before that. */
static void read_metadata(const WebPData *file, struct image_info *info, struct color *color) {
    WebPDemuxer *demuxer = WebPDemux(file);
    WebPChunkIterator chunk;
    if (!demuxer)
        return;
    if (WebPDemuxGetChunk(demuxer, "EXIF", 1, &chunk)) {
        size_t skip = chunk.chunk.size >= 6 && memcmp(chunk.chunk.bytes, "Exif\0", 6) == 0 ? 6 : 0;
        image_parse_exif(chunk.chunk.bytes + skip, chunk.chunk.size - skip, info);
        WebPDemuxReleaseChunkIterator(&chunk);
    }
    if (color && WebPDemuxGetChunk(demuxer, "ICCP", 1, &chunk)) {
        color_set_profile(color, chunk.chunk.bytes, chunk.chunk.size, false, 8);
        WebPDemuxReleaseChunkIterator(&chunk);
    } else if (color) {
        image_color_by_exif(info, color);
    }
    WebPDemuxDelete(demuxer);
}

static enum status decode(const struct image_source *source, const WebPData *file, bool has_alpha, struct image *image,
                          struct error *err) {
    WebPDecoderConfig config;
    size_t row = (size_t)image->width * image->channel_count, size = row * image->height;
    if (!WebPInitDecoderConfig(&config))
        return error_set(err, STATUS_INTERNAL, "libwebp is of another version than its header");
    uint8_t *stored = mem_alloc(size);
    config.output.colorspace = has_alpha ? MODE_RGBA : MODE_RGB;
    config.output.is_external_memory = 1;
    config.output.u.RGBA.rgba = stored;
    config.output.u.RGBA.stride = (int)row;
    config.output.u.RGBA.size = size;
    VP8StatusCode code = WebPDecode(file->bytes, file->size, &config);
    if (code == VP8_STATUS_OK) {
        image_allocate(image);
        for (size_t i = 0; i < size; i++)
            image->pixel[i] = (float)stored[i] / 255.0f;
    }
    WebPFreeDecBuffer(&config.output);
    mem_free(stored);
    return code == VP8_STATUS_OK ? STATUS_OK : refuse(source, code, err);
}

enum status image_read_webp(struct image_source *source, bool probe, struct image *image, struct image_info *info,
                            struct error *err) {
    WebPBitstreamFeatures features;
    enum status status = read_header(source, &features, image, info, err);
    if (status != STATUS_OK)
        return status;
    uint8_t *bytes = mem_alloc((size_t)source->size);
    WebPData file = {bytes, image_source_read(source, 0, bytes, (size_t)source->size)};
    bool wants_color = !probe && !source->as_stored;
    struct color color;
    color_init(&color);
    read_metadata(&file, info, wants_color ? &color : NULL);
    if (!probe)
        status = decode(source, &file, features.has_alpha != 0, image, err);
    if (status == STATUS_OK && wants_color)
        image_convert(image, info, &color);
    color_release(&color);
    mem_free(bytes);
    return status;
}

void image_webp_version(char text[IMAGE_VERSION_SIZE]) {
    int version = WebPGetDecoderVersion(); /* a byte each */
    snprintf(text, IMAGE_VERSION_SIZE, "%d.%d.%d", version >> 16, version >> 8 & 255, version & 255);
}
