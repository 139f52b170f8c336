/* exr_decode.c -- decodes the pixels of an EXR file, chunk by chunk, by the C library OpenEXRCore
 * (openexr.com/en/latest/OpenEXRCoreAPI). Every chunk is checked to lie inside the data window first. */
#include "common/exr_reader.h"
#include "common/exr_unzip.h"
#include "common/mem.h"

/* Receiver of a chunk's rows; the pipeline's user data. */
struct receiver {
    void (*take)(void *user, const struct exr_row *row);
    void *user;
    uint32_t x, y; /* of the chunk's corner */
    bool is_zip;
};

/* A chunk holds line after line, each with the channels' rows in sequence. */
static void hand_out(const exr_decode_pipeline_t *pipeline, const struct receiver *to, const uint8_t *from) {
    struct exr_row row = {.x = to->x, .width = (uint32_t)pipeline->chunk.width};
    for (int y = 0; y < pipeline->chunk.height; y++)
        for (int i = 0; i < pipeline->channel_count; i++) {
            const exr_coding_channel_info_t *channel = &pipeline->channels[i];
            row.channel = i;
            row.type = channel->data_type;
            row.y = to->y + (uint32_t)y;
            row.values = from;
            to->take(to->user, &row);
            from += (size_t)row.width * (size_t)channel->bytes_per_element;
        }
}

/* Replaces the library's unpacking, which in 3.1.5 mixes up the channels of interleaved RGBA halves. */
static exr_result_t unpack(exr_decode_pipeline_t *pipeline) {
    const struct receiver *to = pipeline->decoding_user_data;
    const uint8_t *from = pipeline->unpacked_buffer;
    size_t size = (size_t)pipeline->chunk.unpacked_size, line_bytes = 0;
    for (int i = 0; i < pipeline->channel_count; i++)
        line_bytes += (size_t)pipeline->chunk.width * (size_t)pipeline->channels[i].bytes_per_element;
    if (!from || line_bytes * (size_t)pipeline->chunk.height != size)
        return EXR_ERR_CORRUPT_CHUNK;
    uint8_t *unzipped = to->is_zip && pipeline->chunk.packed_size == size ? mem_alloc(size) : NULL;
    if (unzipped && exr_unzip(from, size, unzipped))
        from = unzipped;
    hand_out(pipeline, to, from);
    mem_free(unzipped);
    return EXR_ERR_SUCCESS;
}

/* Decodes the chunk with its corner at (x, y). The first call sets the pipeline up, the others reuse its buffers. */
static exr_result_t decode_chunk(const struct exr_reader *r, exr_decode_pipeline_t *pipeline,
                                 const exr_chunk_info_t *chunk, struct receiver *to, uint32_t x, uint32_t y) {
    if (chunk->width < 0 || chunk->height < 0 || (uint64_t)x + (uint64_t)chunk->width > exr_data_width(r) ||
        (uint64_t)y + (uint64_t)chunk->height > exr_data_height(r))
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
    to->x = x;
    to->y = y;
    pipeline->decoding_user_data = to;
    pipeline->unpack_and_convert_fn = unpack;
    return exr_decoding_run(r->context, r->part, pipeline);
}

static exr_result_t decode_scanlines(const struct exr_reader *r, exr_decode_pipeline_t *pipeline, struct receiver *to) {
    int32_t lines = 0;
    exr_result_t code = exr_get_scanlines_per_chunk(r->context, r->part, &lines);
    if (code == EXR_ERR_SUCCESS && lines < 1)
        code = EXR_ERR_UNKNOWN;
    for (uint32_t y = 0; code == EXR_ERR_SUCCESS && y < exr_data_height(r); y += (uint32_t)lines) {
        exr_chunk_info_t chunk;
        code = exr_read_scanline_chunk_info(r->context, r->part, r->data.min.y + (int32_t)y, &chunk);
        if (code == EXR_ERR_SUCCESS)
            code = decode_chunk(r, pipeline, &chunk, to, 0, y);
    }
    return code;
}

/* Level 0 only: the picture at full size. */
static exr_result_t decode_tiles(const struct exr_reader *r, exr_decode_pipeline_t *pipeline, struct receiver *to) {
    int32_t width = 0, height = 0;
    exr_result_t code = exr_get_tile_sizes(r->context, r->part, 0, 0, &width, &height);
    if (code == EXR_ERR_SUCCESS && (width < 1 || height < 1))
        code = EXR_ERR_UNKNOWN;
    for (uint32_t y = 0; code == EXR_ERR_SUCCESS && y < exr_data_height(r); y += (uint32_t)height)
        for (uint32_t x = 0; code == EXR_ERR_SUCCESS && x < exr_data_width(r); x += (uint32_t)width) {
            exr_chunk_info_t chunk;
            code = exr_read_tile_chunk_info(r->context, r->part, (int)(x / (uint32_t)width),
                                            (int)(y / (uint32_t)height), 0, 0, &chunk);
            if (code == EXR_ERR_SUCCESS)
                code = decode_chunk(r, pipeline, &chunk, to, x, y);
        }
    return code;
}

enum status exr_decode(const struct exr_reader *r, void (*take)(void *user, const struct exr_row *row), void *user,
                       struct error *err) {
    struct receiver to = {.take = take,
                          .user = user,
                          .is_zip = r->compression == EXR_COMPRESSION_ZIP || r->compression == EXR_COMPRESSION_ZIPS};
    exr_decode_pipeline_t pipeline = EXR_DECODE_PIPELINE_INITIALIZER;
    exr_result_t code =
        r->storage == EXR_STORAGE_TILED ? decode_tiles(r, &pipeline, &to) : decode_scanlines(r, &pipeline, &to);
    exr_decoding_destroy(r->context, &pipeline);
    return code == EXR_ERR_SUCCESS ? STATUS_OK : exr_stream_refuse(r->stream, code, err);
}
