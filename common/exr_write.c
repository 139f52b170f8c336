/* exr_write.c -- writing OpenEXR pictures by OpenEXRCore. Written bytes depend on pixels and notes alone: no
 * time, no host, no thread order. */
#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/exr_stream.h"

enum { TILE_SIDE = 64 };

struct encoder {
    exr_result_t (*compress)(exr_encode_pipeline_t *); /* the library's */
};

static exr_result_t write_header(exr_context_t context, const struct image *image, enum image_exr_type type, bool tiled,
                                 const struct image_note *note, size_t note_count) {
    /* ITU-R BT.709: red, green, blue, white. */
    static const exr_attr_chromaticities_t rec709 = {0.64f, 0.33f, 0.30f, 0.60f, 0.15f, 0.06f, 0.3127f, 0.3290f};
    int part = 0;
    exr_result_t code = exr_add_part(context, NULL, tiled ? EXR_STORAGE_TILED : EXR_STORAGE_SCANLINE, &part);
    if (code == EXR_ERR_SUCCESS)
        code = exr_initialize_required_attr_simple(context, part, (int32_t)image->width, (int32_t)image->height,
                                                   EXR_COMPRESSION_ZIP);
    if (code == EXR_ERR_SUCCESS && tiled)
        code = exr_set_tile_descriptor(context, part, TILE_SIDE, TILE_SIDE, EXR_TILE_ONE_LEVEL, EXR_TILE_ROUND_DOWN);
    if (code == EXR_ERR_SUCCESS && image_channel(image, "R") >= 0 && image_channel(image, "G") >= 0 &&
        image_channel(image, "B") >= 0)
        code = exr_attr_set_chromaticities(context, part, "chromaticities", &rec709);
    for (size_t i = 0; code == EXR_ERR_SUCCESS && i < note_count; i++)
        code = exr_attr_set_string(context, part, note[i].name, note[i].text);
    for (uint32_t c = 0; code == EXR_ERR_SUCCESS && c < image->channel_count; c++)
        code = exr_add_channel(context, part, image->channel[c], type == IMAGE_HALF ? EXR_PIXEL_HALF : EXR_PIXEL_FLOAT,
                               EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1);
    return code == EXR_ERR_SUCCESS ? exr_write_header(context) : code;
}

/* Wraps the library's compression step. Readers take a chunk whose stored size equals its raw size for raw pixels,
 * but the library (up to 3.4.6, its issue 2306) stores raw pixels only when the zlib stream is larger, not when it is
 * equal. */
static exr_result_t compress_or_store(exr_encode_pipeline_t *pipeline) {
    const struct encoder *encoder = pipeline->encoding_user_data;
    exr_result_t code = encoder->compress(pipeline);
    if (code == EXR_ERR_SUCCESS && pipeline->compressed_bytes >= pipeline->packed_bytes) {
        memcpy(pipeline->compressed_buffer, pipeline->packed_buffer, pipeline->packed_bytes);
        pipeline->compressed_bytes = pipeline->packed_bytes;
    }
    return code;
}

static exr_result_t encode_chunk(exr_context_t context, struct encoder *encoder, exr_encode_pipeline_t *pipeline,
                                 const exr_chunk_info_t *chunk, uint32_t x, uint32_t y, const struct image *image) {
    bool first = pipeline->channels == NULL;
    exr_result_t code =
        first ? exr_encoding_initialize(context, 0, chunk, pipeline) : exr_encoding_update(context, 0, chunk, pipeline);
    if (code != EXR_ERR_SUCCESS)
        return code;
    size_t stride = image->channel_count * sizeof(float);
    const float *corner = image->pixel + ((size_t)y * image->width + x) * image->channel_count;
    for (int i = 0; i < pipeline->channel_count; i++) {
        exr_coding_channel_info_t *channel = &pipeline->channels[i];
        int from = image_channel(image, channel->channel_name);
        channel->encode_from_ptr = (const uint8_t *)(corner + from);
        channel->user_bytes_per_element = sizeof(float);
        channel->user_data_type = EXR_PIXEL_FLOAT;
        channel->user_pixel_stride = (int32_t)stride;
        channel->user_line_stride = (int32_t)(stride * image->width);
    }
    if (first) {
        code = exr_encoding_choose_default_routines(context, 0, pipeline);
        encoder->compress = pipeline->compress_fn;
        pipeline->compress_fn = compress_or_store;
        pipeline->encoding_user_data = encoder;
    }
    return code == EXR_ERR_SUCCESS ? exr_encoding_run(context, 0, pipeline) : code;
}

static exr_result_t write_chunks(exr_context_t context, const struct image *image, bool tiled) {
    exr_encode_pipeline_t pipeline = EXR_ENCODE_PIPELINE_INITIALIZER;
    struct encoder encoder = {0};
    int32_t lines = TILE_SIDE;
    exr_result_t code = EXR_ERR_SUCCESS;
    if (!tiled)
        code = exr_get_scanlines_per_chunk(context, 0, &lines);
    uint32_t step_x = tiled ? TILE_SIDE : image->width, step_y = (uint32_t)lines;
    for (uint32_t y = 0; code == EXR_ERR_SUCCESS && y < image->height; y += step_y)
        for (uint32_t x = 0; code == EXR_ERR_SUCCESS && x < image->width; x += step_x) {
            exr_chunk_info_t chunk;
            if (tiled)
                code = exr_write_tile_chunk_info(context, 0, (int)(x / TILE_SIDE), (int)(y / TILE_SIDE), 0, 0, &chunk);
            else
                code = exr_write_scanline_chunk_info(context, 0, (int)y, &chunk);
            if (code == EXR_ERR_SUCCESS)
                code = encode_chunk(context, &encoder, &pipeline, &chunk, x, y, image);
        }
    exr_encoding_destroy(context, &pipeline);
    return code;
}

enum status image_write_exr(const char *path, const struct image *image, enum image_exr_type type, bool tiled,
                            struct error *err) {
    return image_write_exr_noted(path, image, type, tiled, NULL, 0, err);
}

enum status image_write_exr_noted(const char *path, const struct image *image, enum image_exr_type type, bool tiled,
                                  const struct image_note *note, size_t note_count, struct error *err) {
    struct exr_stream stream = {.fd = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666)};
    if (stream.fd < 0)
        return error_set_errno(err, errno, "cannot create %s", path);
    exr_context_initializer_t init = exr_stream_writer(&stream);
    exr_context_t context;
    exr_result_t code = exr_start_write(&context, path, EXR_WRITE_FILE_DIRECTLY, &init);
    if (code == EXR_ERR_SUCCESS) {
        code = write_header(context, image, type, tiled, note, note_count);
        if (code == EXR_ERR_SUCCESS)
            code = write_chunks(context, image, tiled);
        exr_result_t finish = exr_finish(&context); /* writes the table of chunks */
        if (code == EXR_ERR_SUCCESS)
            code = finish;
    }
    enum status status = STATUS_OK;
    if (stream.io_error)
        status = error_set_errno(err, stream.io_error, "cannot write %s", path);
    else if (code != EXR_ERR_SUCCESS)
        status = error_set(err, STATUS_INTERNAL, "cannot write %s: %s", path, exr_get_default_error_message(code));
    struct stat facts;
    bool is_file = fstat(stream.fd, &facts) == 0 && S_ISREG(facts.st_mode);
    if (close(stream.fd) != 0 && status == STATUS_OK)
        status = error_set_errno(err, errno, "cannot close %s", path);
    return status == STATUS_OK && is_file ? image_check_exr(path, image, err) : status;
}
