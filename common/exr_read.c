/* exr_read.c -- OpenEXR pictures by the C library OpenEXRCore (openexr.com/en/latest/OpenEXRCoreAPI).
 *
 * Invariants:
 *  1. A file's sizes are checked against image.h's limits and against the file's own length
 *     before pixels are asked for: a chunk takes at least 8 bytes of table and compresses at
 *     most MAX_RATIO : 1, so a small file cannot ask for a large picture.
 *  2. Every chunk lies inside the data window (checked), so the library writes only into our
 *     pixels. */
#include <limits.h>
#include <stdlib.h>
#include <string.h>

#include "common/exr_stream.h"
#include "common/exr_unzip.h"
#include "common/mem.h"

/* Deflate reaches 1032 : 1, after PXR24 has dropped a byte of four. */
#define MAX_RATIO 1536

/* One file being read. */
struct reader {
    exr_context_t context;
    struct exr_stream *stream;
    int part;
    exr_storage_t storage;
    exr_compression_t compression;
    const exr_attr_chlist_t *list;
    exr_attr_box2i_t data, display;
    int grey;                       /* index in `list` of the Y that becomes R, G and B; or -1 */
    int target[IMAGE_MAX_CHANNELS]; /* channel of the picture for each of `list` */
};

static int find_channel(const exr_attr_chlist_t *list, const char *name) {
    for (int i = 0; i < list->num_channels; i++)
        if (strcmp(list->entries[i].name.str, name) == 0)
            return i;
    return -1;
}

/* Takes the first part with R, G and B; failing that, the first one that is not deep. */
static enum status choose_part(struct reader *r, struct error *err) {
    int part_count = 0;
    exr_result_t code = exr_get_count(r->context, &part_count);
    r->part = -1;
    for (int i = 0; code == EXR_ERR_SUCCESS && i < part_count; i++) {
        exr_storage_t storage;
        const exr_attr_chlist_t *list;
        code = exr_get_storage(r->context, i, &storage);
        if (code != EXR_ERR_SUCCESS || storage > EXR_STORAGE_TILED)
            continue;
        code = exr_get_channels(r->context, i, &list);
        if (code != EXR_ERR_SUCCESS)
            break;
        bool colour = find_channel(list, "R") >= 0 && find_channel(list, "G") >= 0 &&
                      find_channel(list, "B") >= 0;
        if (r->part < 0 || colour) {
            r->part = i;
            r->storage = storage;
            r->list = list;
        }
        if (colour)
            break;
    }
    if (code != EXR_ERR_SUCCESS)
        return exr_stream_refuse(r->stream, code, err);
    if (r->part < 0)
        return error_set(err, STATUS_INPUT,
                         "%s: the EXR holds only deep data; a flat picture was expected",
                         r->stream->source->name);
    return STATUS_OK;
}

/* Refuses what the picture cannot hold. */
static enum status check_channels(const struct reader *r, struct error *err) {
    const exr_attr_chlist_t *list = r->list;
    const char *file = r->stream->source->name;
    if (list->num_channels > IMAGE_MAX_CHANNELS - 2) /* grey becomes three */
        return error_set(err, STATUS_LIMIT, "%s: %d channels are more than the limit of %d", file,
                         list->num_channels, IMAGE_MAX_CHANNELS - 2);
    bool half = true;
    for (int i = 0; i < list->num_channels; i++) {
        const exr_attr_chlist_entry_t *entry = &list->entries[i];
        char name[sizeof ((struct image *)NULL)->channel[0]];
        exr_stream_printable(entry->name.str, name, sizeof name);
        if (entry->x_sampling != 1 || entry->y_sampling != 1)
            return error_set(err, STATUS_INPUT,
                             "%s: channel %s is subsampled %d x %d (luminance/chroma EXR); only "
                             "full-resolution channels can be read", file, name,
                             entry->x_sampling, entry->y_sampling);
        if (strlen(entry->name.str) >= sizeof name)
            return error_set(err, STATUS_INPUT, "%s: the channel name %s... is too long", file,
                             name);
        half = half && entry->pixel_type == EXR_PIXEL_HALF;
    }
    if (r->compression <= EXR_COMPRESSION_PXR24 ||
        (half && r->compression <= EXR_COMPRESSION_B44A))
        return STATUS_OK;
    /* OpenEXRCore 3.1.5 has no DWA and mixes up the rows of B44's other channels. */
    error_set(err, STATUS_INPUT, "%s: this reader knows no EXR compression %s", file,
              r->compression <= EXR_COMPRESSION_B44A ? "B44 of channels other than half"
                                                     : "DWAA or DWAB");
    return error_hint(err, "save the file with ZIP or PIZ compression");
}

/* Gives every channel of the file its place: R, G, B, A first, then the rest in the file's
 * (alphabetical) order. Fills name[] and returns the count of the picture's channels. */
static uint32_t order_channels(struct reader *r, const char **name) {
    const exr_attr_chlist_t *list = r->list;
    bool colour = find_channel(list, "R") >= 0 || find_channel(list, "G") >= 0 ||
                  find_channel(list, "B") >= 0;
    uint32_t count = 0;
    r->grey = colour ? -1 : find_channel(list, "Y");
    for (int i = 0; i < list->num_channels; i++)
        r->target[i] = -1;
    if (r->grey >= 0) {
        r->target[r->grey] = 0;
        for (; count < 3; count++)
            name[count] = image_rgba[count];
    }
    for (int k = 0; k < 4; k++) {
        int i = find_channel(list, image_rgba[k]);
        if (i < 0)
            continue;
        r->target[i] = (int)count;
        name[count++] = image_rgba[k];
    }
    for (int i = 0; i < list->num_channels; i++) {
        if (r->target[i] >= 0)
            continue;
        r->target[i] = (int)count;
        name[count++] = list->entries[i].name.str;
    }
    return count;
}

static int64_t side(int32_t min, int32_t max) {
    return (int64_t)max - min + 1;
}

/* Invariant 1. */
static enum status check_plausible(const struct reader *r, struct error *err) {
    const struct image_source *source = r->stream->source;
    int32_t chunk_count = 0;
    exr_result_t code = exr_get_chunk_count(r->context, r->part, &chunk_count);
    if (code != EXR_ERR_SUCCESS)
        return exr_stream_refuse(r->stream, code, err);
    uint64_t pixel_bytes = 0;
    for (int i = 0; i < r->list->num_channels; i++)
        pixel_bytes += r->list->entries[i].pixel_type == EXR_PIXEL_HALF ? 2 : 4;
    uint64_t bytes = pixel_bytes * (uint64_t)side(r->data.min.x, r->data.max.x) *
                     (uint64_t)side(r->data.min.y, r->data.max.y);
    uint64_t ratio = r->compression == EXR_COMPRESSION_NONE ? 1 : MAX_RATIO;
    if (chunk_count < 1 || (uint64_t)chunk_count * 8 > source->size ||
        bytes / ratio > source->size)
        return error_set(err, STATUS_INPUT,
                         "%s: damaged EXR: the file's %llu bytes cannot hold the picture that its "
                         "header promises", source->name, (unsigned long long)source->size);
    return STATUS_OK;
}

static enum status read_header(struct reader *r, struct image *image, struct image_info *info,
                               struct error *err) {
    enum status status = choose_part(r, err);
    if (status != STATUS_OK)
        return status;
    exr_result_t code = exr_get_data_window(r->context, r->part, &r->data);
    if (code == EXR_ERR_SUCCESS)
        code = exr_get_display_window(r->context, r->part, &r->display);
    if (code == EXR_ERR_SUCCESS)
        code = exr_get_compression(r->context, r->part, &r->compression);
    if (code != EXR_ERR_SUCCESS)
        return exr_stream_refuse(r->stream, code, err);
    status = check_channels(r, err);
    if (status != STATUS_OK)
        return status;
    const char *name[IMAGE_MAX_CHANNELS];
    uint32_t channel_count = order_channels(r, name);
    const exr_attr_box2i_t *windows[2] = {&r->data, &r->display};
    for (int i = 0; i < 2; i++) { /* both have to pass; the display window is what stays */
        image_release(image);
        int64_t width = side(windows[i]->min.x, windows[i]->max.x);
        int64_t height = side(windows[i]->min.y, windows[i]->max.y);
        status = image_header(image, r->stream->source->name, width < 0 ? 0 : (uint64_t)width,
                              height < 0 ? 0 : (uint64_t)height, channel_count, name, err);
        if (status != STATUS_OK)
            return status;
    }
    if (r->data.min.x > r->display.max.x || r->data.max.x < r->display.min.x ||
        r->data.min.y > r->display.max.y || r->data.max.y < r->display.min.y)
        return error_set(err, STATUS_INPUT,
                         "%s: the EXR's data window lies outside its display window",
                         r->stream->source->name);
    info->encoding = IMAGE_LINEAR;
    info->bits = 16;
    for (int i = 0; i < r->list->num_channels; i++)
        if (r->list->entries[i].pixel_type != EXR_PIXEL_HALF)
            info->bits = 32;
    return check_plausible(r, err);
}

/* Where a chunk's values go; the pipeline's user data. */
struct destination {
    const int *target;                /* [channel_count] channel of the picture */
    size_t pixel_stride, line_stride; /* floats */
    float *corner;
    bool is_zip;
};

static void unpack_row(const uint8_t *from, uint16_t type, size_t width, size_t stride, float *to) {
    if (type == EXR_PIXEL_HALF)
        for (size_t x = 0; x < width; x++)
            to[x * stride] = image_float_from_half((uint16_t)(from[2 * x] | from[2 * x + 1] << 8));
    else
        for (size_t x = 0; x < width; x++) {
            uint32_t bits = (uint32_t)from[4 * x] | (uint32_t)from[4 * x + 1] << 8 |
                            (uint32_t)from[4 * x + 2] << 16 | (uint32_t)from[4 * x + 3] << 24;
            float value = (float)bits;
            if (type == EXR_PIXEL_FLOAT)
                memcpy(&value, &bits, sizeof value);
            to[x * stride] = value;
        }
}

/* A chunk holds line after line, in each the channels' rows one after the other. */
static void unpack_lines(const exr_decode_pipeline_t *pipeline, const struct destination *d, const uint8_t *from) {
    size_t width = (size_t)pipeline->chunk.width;
    for (int y = 0; y < pipeline->chunk.height; y++)
        for (int i = 0; i < pipeline->channel_count; i++) {
            const exr_coding_channel_info_t *channel = &pipeline->channels[i];
            unpack_row(from, channel->data_type, width, d->pixel_stride,
                       d->corner + (size_t)y * d->line_stride + d->target[i]);
            from += width * (size_t)channel->bytes_per_element;
        }
}

/* In place of the library's own unpacking, which in 3.1.5 mixes up the channels of interleaved
 * RGBA halves. */
static exr_result_t unpack(exr_decode_pipeline_t *pipeline) {
    const struct destination *d = pipeline->decoding_user_data;
    const uint8_t *from = pipeline->unpacked_buffer;
    size_t width = (size_t)pipeline->chunk.width, line_bytes = 0;
    for (int i = 0; i < pipeline->channel_count; i++)
        line_bytes += width * (size_t)pipeline->channels[i].bytes_per_element;
    if (!from || line_bytes * (size_t)pipeline->chunk.height != pipeline->chunk.unpacked_size)
        return EXR_ERR_CORRUPT_CHUNK;
    uint64_t size = pipeline->chunk.unpacked_size;
    bool is_raw = pipeline->chunk.packed_size == size;
    uint8_t *unzipped = d->is_zip && is_raw ? mem_alloc((size_t)size) : NULL;
    if (unzipped && exr_unzip(from, (size_t)size, unzipped))
        from = unzipped;
    unpack_lines(pipeline, d, from);
    mem_free(unzipped);
    return EXR_ERR_SUCCESS;
}

/* Decodes one chunk to its place in `image`, which covers the data window. The first call sets
 * the pipeline up, the others reuse its buffers. */
static exr_result_t decode_chunk(const struct reader *r, exr_decode_pipeline_t *pipeline,
                                 const exr_chunk_info_t *chunk, uint32_t x, uint32_t y,
                                 const struct image *image) {
    if (chunk->width < 0 || chunk->height < 0 ||
        (uint64_t)x + (uint64_t)chunk->width > image->width ||
        (uint64_t)y + (uint64_t)chunk->height > image->height)
        return EXR_ERR_BAD_CHUNK_LEADER;
    exr_result_t code;
    if (pipeline->channels) {
        code = exr_decoding_update(r->context, r->part, chunk, pipeline);
    } else {
        code = exr_decoding_initialize(r->context, r->part, chunk, pipeline);
        if (code == EXR_ERR_SUCCESS)
            code = exr_decoding_choose_default_routines(r->context, r->part, pipeline);
    }
    if (code != EXR_ERR_SUCCESS)
        return code;
    size_t stride = image->channel_count, line_stride = stride * image->width;
    struct destination destination = {.target = r->target,
                                      .pixel_stride = stride,
                                      .line_stride = line_stride,
                                      .corner = image->pixel + y * line_stride + x * stride,
                                      .is_zip = r->compression == EXR_COMPRESSION_ZIP ||
                                                r->compression == EXR_COMPRESSION_ZIPS};
    pipeline->decoding_user_data = &destination;
    pipeline->unpack_and_convert_fn = unpack;
    return exr_decoding_run(r->context, r->part, pipeline);
}

static exr_result_t decode_scanlines(const struct reader *r, exr_decode_pipeline_t *pipeline,
                                     const struct image *image) {
    int32_t lines = 0;
    exr_result_t code = exr_get_scanlines_per_chunk(r->context, r->part, &lines);
    if (code == EXR_ERR_SUCCESS && lines < 1)
        code = EXR_ERR_UNKNOWN;
    for (uint32_t y = 0; code == EXR_ERR_SUCCESS && y < image->height; y += (uint32_t)lines) {
        exr_chunk_info_t chunk;
        code = exr_read_scanline_chunk_info(r->context, r->part, r->data.min.y + (int32_t)y,
                                            &chunk);
        if (code == EXR_ERR_SUCCESS)
            code = decode_chunk(r, pipeline, &chunk, 0, y, image);
    }
    return code;
}

/* Level 0 only: the picture at full size. */
static exr_result_t decode_tiles(const struct reader *r, exr_decode_pipeline_t *pipeline,
                                 const struct image *image) {
    int32_t width = 0, height = 0;
    exr_result_t code = exr_get_tile_sizes(r->context, r->part, 0, 0, &width, &height);
    if (code == EXR_ERR_SUCCESS && (width < 1 || height < 1))
        code = EXR_ERR_UNKNOWN;
    for (uint32_t y = 0; code == EXR_ERR_SUCCESS && y < image->height; y += (uint32_t)height)
        for (uint32_t x = 0; code == EXR_ERR_SUCCESS && x < image->width; x += (uint32_t)width) {
            exr_chunk_info_t chunk;
            code = exr_read_tile_chunk_info(r->context, r->part, (int)(x / (uint32_t)width),
                                            (int)(y / (uint32_t)height), 0, 0, &chunk);
            if (code == EXR_ERR_SUCCESS)
                code = decode_chunk(r, pipeline, &chunk, x, y, image);
        }
    return code;
}

static void copy_grey(struct image *image) {
    size_t pixel_count = (size_t)image->width * image->height;
    float *pixel = image->pixel;
    for (size_t i = 0; i < pixel_count; i++, pixel += image->channel_count)
        pixel[1] = pixel[2] = pixel[0];
}

/* Copies the part of `from` (the data window) that lies in `to` (the display window). */
static void copy_window(const struct reader *r, const struct image *from, struct image *to) {
    int64_t dx = (int64_t)r->data.min.x - r->display.min.x;
    int64_t dy = (int64_t)r->data.min.y - r->display.min.y;
    int64_t x0 = dx > 0 ? dx : 0, x1 = dx + from->width < to->width ? dx + from->width : to->width;
    size_t stride = to->channel_count;
    for (int64_t y = 0; y < to->height && x0 < x1; y++) {
        if (y < dy || y >= dy + from->height)
            continue;
        memcpy(to->pixel + ((size_t)y * to->width + (size_t)x0) * stride,
               from->pixel + ((size_t)(y - dy) * from->width + (size_t)(x0 - dx)) * stride,
               (size_t)(x1 - x0) * stride * sizeof(float));
    }
}

static enum status decode(const struct reader *r, struct image *image, struct error *err) {
    exr_decode_pipeline_t pipeline = EXR_DECODE_PIPELINE_INITIALIZER;
    exr_result_t code = r->storage == EXR_STORAGE_TILED ? decode_tiles(r, &pipeline, image)
                                                        : decode_scanlines(r, &pipeline, image);
    exr_decoding_destroy(r->context, &pipeline);
    if (code != EXR_ERR_SUCCESS)
        return exr_stream_refuse(r->stream, code, err);
    if (r->grey >= 0)
        copy_grey(image);
    return STATUS_OK;
}

static enum status read_pixels(const struct reader *r, struct image *image, struct error *err) {
    image_allocate(image);
    if (memcmp(&r->data, &r->display, sizeof r->data) == 0)
        return decode(r, image, err);
    struct image inner = *image; /* the names are only borrowed */
    inner.width = (uint32_t)side(r->data.min.x, r->data.max.x);
    inner.height = (uint32_t)side(r->data.min.y, r->data.max.y);
    image_allocate(&inner);
    enum status status = decode(r, &inner, err);
    if (status == STATUS_OK)
        copy_window(r, &inner, image);
    mem_free(inner.pixel);
    return status;
}

enum status image_read_exr(struct image_source *source, bool probe, struct image *image,
                           struct image_info *info, struct error *err) {
    struct exr_stream stream = {.source = source, .fd = -1};
    struct reader r = {.stream = &stream};
    exr_context_initializer_t init = exr_stream_reader(&stream);
    exr_result_t code = exr_start_read(&r.context, source->name, &init);
    if (code != EXR_ERR_SUCCESS)
        return exr_stream_refuse(&stream, code, err);
    enum status status = read_header(&r, image, info, err);
    if (status == STATUS_OK && !probe)
        status = read_pixels(&r, image, err);
    exr_finish(&r.context);
    return status;
}
