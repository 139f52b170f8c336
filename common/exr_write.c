/* exr_write.c -- writing OpenEXR pictures by OpenEXRCore. Written bytes depend on pixels and notes alone: no
 * time, no host, no thread order. */
#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/exr_stream.h"
#include "common/mem.h"

enum { TILE_SIDE = 64 };

/* Chunks that are encoded before they are written: 12 MiB of float RGB. */
#define SLICE 256

/* A thread's. */
struct encoder {
    exr_encode_pipeline_t pipeline;
    exr_result_t (*compress)(exr_encode_pipeline_t *); /* the library's */
    struct encoded *encoded;                           /* the chunk in work */
};

struct encoded {
    int column, row; /* of chunks */
    exr_chunk_info_t chunk;
    exr_result_t code;
    void *data; /* [size] as it is stored; owned */
    uint64_t size;
};

struct encoding {
    exr_context_t context;
    const struct image *image;
    bool tiled;
    uint32_t step_x, step_y; /* pixels of a chunk */
    struct encoder *encoder; /* [threads] */
    struct encoded encoded[SLICE];
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

/* In place of the library's writing step: the chunk waits for those before it. */
static exr_result_t keep_chunk(exr_encode_pipeline_t *pipeline) {
    struct encoder *encoder = (struct encoder *)pipeline->encoding_user_data;
    encoder->encoded->size = pipeline->compressed_bytes;
    encoder->encoded->data = mem_array(pipeline->compressed_bytes + 1, 1);
    memcpy(encoder->encoded->data, pipeline->compressed_buffer, pipeline->compressed_bytes);
    return EXR_ERR_SUCCESS;
}

static void set_channels(const struct encoding *e, exr_encode_pipeline_t *pipeline, const struct encoded *encoded) {
    const struct image *image = e->image;
    size_t x = (size_t)encoded->column * e->step_x, y = (size_t)encoded->row * e->step_y;
    size_t stride = image->channel_count * sizeof(float);
    const float *corner = image->pixel + (y * image->width + x) * image->channel_count;
    for (int i = 0; i < pipeline->channel_count; i++) {
        exr_coding_channel_info_t *channel = &pipeline->channels[i];
        int from = image_channel(image, channel->channel_name);
        channel->encode_from_ptr = (const uint8_t *)(corner + from);
        channel->user_bytes_per_element = sizeof(float);
        channel->user_data_type = EXR_PIXEL_FLOAT;
        channel->user_pixel_stride = (int32_t)stride;
        channel->user_line_stride = (int32_t)(stride * image->width);
    }
}

static exr_result_t encode_chunk(const struct encoding *e, struct encoder *encoder, struct encoded *encoded) {
    exr_encode_pipeline_t *pipeline = &encoder->pipeline;
    bool first = pipeline->channels == NULL;
    exr_result_t code = first ? exr_encoding_initialize(e->context, 0, &encoded->chunk, pipeline)
                              : exr_encoding_update(e->context, 0, &encoded->chunk, pipeline);
    if (code != EXR_ERR_SUCCESS)
        return code;
    set_channels(e, pipeline, encoded);
    if (first) {
        code = exr_encoding_choose_default_routines(e->context, 0, pipeline);
        encoder->compress = pipeline->compress_fn;
        pipeline->compress_fn = compress_or_store;
        pipeline->yield_until_ready_fn = NULL; /* the library's refuses a chunk whose turn to be written it is not */
        pipeline->write_fn = keep_chunk;
        pipeline->encoding_user_data = encoder;
    }
    encoder->encoded = encoded;
    return code == EXR_ERR_SUCCESS ? exr_encoding_run(e->context, 0, pipeline) : code;
}

static void encode_one(void *user, size_t index, int thread) {
    struct encoding *e = user;
    if (e->encoded[index].code == EXR_ERR_SUCCESS)
        e->encoded[index].code = encode_chunk(e, &e->encoder[thread], &e->encoded[index]);
}

/* Fills what the library is told of `count` chunks from number `first` on, row by row. */
static void begin_chunks(struct encoding *e, size_t first, size_t count) {
    size_t columns = (e->image->width + e->step_x - 1) / e->step_x;
    for (size_t i = 0; i < count; i++) {
        struct encoded *to = &e->encoded[i];
        *to = (struct encoded){.column = (int)((first + i) % columns), .row = (int)((first + i) / columns)};
        to->code = e->tiled ? exr_write_tile_chunk_info(e->context, 0, to->column, to->row, 0, 0, &to->chunk)
                            : exr_write_scanline_chunk_info(e->context, 0, to->row * (int)e->step_y, &to->chunk);
    }
}

static exr_result_t write_encoded(struct encoding *e, struct encoded *chunk) {
    exr_result_t code = chunk->code;
    if (code == EXR_ERR_SUCCESS)
        code = e->tiled
                   ? exr_write_tile_chunk(e->context, 0, chunk->column, chunk->row, 0, 0, chunk->data, chunk->size)
                   : exr_write_scanline_chunk(e->context, 0, chunk->row * (int)e->step_y, chunk->data, chunk->size);
    mem_free(chunk->data);
    return code;
}

static exr_result_t write_chunks(exr_context_t context, const struct image *image, bool tiled, struct parallel *pool) {
    struct encoding e = {.context = context, .image = image, .tiled = tiled};
    size_t threads = (size_t)parallel_thread_count(pool);
    int32_t lines = TILE_SIDE;
    exr_result_t code = tiled ? EXR_ERR_SUCCESS : exr_get_scanlines_per_chunk(context, 0, &lines);
    e.step_x = tiled ? TILE_SIDE : image->width;
    e.step_y = (uint32_t)lines;
    e.encoder = mem_calloc(threads, sizeof *e.encoder);
    for (size_t i = 0; i < threads; i++)
        e.encoder[i].pipeline = (exr_encode_pipeline_t)EXR_ENCODE_PIPELINE_INITIALIZER;
    size_t chunks = (size_t)((image->width + e.step_x - 1) / e.step_x) * ((image->height + e.step_y - 1) / e.step_y);
    for (size_t first = 0; code == EXR_ERR_SUCCESS && first < chunks; first += SLICE) {
        size_t count = chunks - first < SLICE ? chunks - first : SLICE;
        begin_chunks(&e, first, count);
        parallel_for(pool, count, encode_one, &e);
        for (size_t i = 0; i < count; i++) {
            if (code != EXR_ERR_SUCCESS)
                mem_free(e.encoded[i].data);
            else
                code = write_encoded(&e, &e.encoded[i]);
        }
    }
    for (size_t i = 0; i < threads; i++)
        exr_encoding_destroy(context, &e.encoder[i].pipeline);
    mem_free(e.encoder);
    return code;
}

enum status image_write_exr(const char *path, const struct image *image, enum image_exr_type type, bool tiled,
                            struct error *err) {
    return image_write_exr_noted(path, image, type, tiled, NULL, 0, NULL, err);
}

enum status image_write_exr_noted(const char *path, const struct image *image, enum image_exr_type type, bool tiled,
                                  const struct image_note *note, size_t note_count, struct parallel *pool,
                                  struct error *err) {
    struct exr_stream stream = {.fd = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666)};
    if (stream.fd < 0)
        return error_set_errno(err, errno, "cannot create %s", path);
    exr_context_initializer_t init = exr_stream_writer(&stream);
    exr_context_t context;
    struct parallel *alone = pool ? NULL : parallel_new(1);
    exr_result_t code = exr_start_write(&context, path, EXR_WRITE_FILE_DIRECTLY, &init);
    if (code == EXR_ERR_SUCCESS) {
        code = write_header(context, image, type, tiled, note, note_count);
        if (code == EXR_ERR_SUCCESS)
            code = write_chunks(context, image, tiled, pool ? pool : alone);
        exr_result_t finish = exr_finish(&context); /* writes the table of chunks */
        if (code == EXR_ERR_SUCCESS)
            code = finish;
    }
    parallel_free(alone);
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
