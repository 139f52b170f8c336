/* exr_stream.c -- see exr_stream.h. */
#include "common/exr_stream.h"

#include <errno.h>
#include <unistd.h>

#include "common/mem.h"

/* Largest single allocation; a chunk of the largest picture is smaller. */
#define MAX_ALLOCATION ((size_t)2 << 30)
static void *limited_alloc(size_t bytes) { return bytes <= MAX_ALLOCATION ? mem_alloc(bytes) : NULL; }

const char *exr_stream_printable(const char *text, char *out, size_t size) {
    size_t i = 0;
    for (; text[i] && i < size - 1; i++)
        out[i] = text[i] >= ' ' && text[i] <= '~' ? text[i] : '?';
    out[i] = '\0';
    return out;
}

static void note_error(exr_const_context_t context, exr_result_t code, const char *message) {
    (void)code;
    void *user = NULL;
    exr_get_user_data(context, &user);
    struct exr_stream *stream = user;
    if (stream && stream->message[0] == '\0' && message)
        exr_stream_printable(message, stream->message, sizeof stream->message);
}

/* When writing, the library holds its lock while it reports, and a query of the stream would deadlock. */
static void drop_error(exr_const_context_t context, exr_result_t code, const char *message) {
    (void)context;
    (void)code;
    (void)message;
}

static int64_t stream_read(exr_const_context_t context, void *user, void *buffer, uint64_t size, uint64_t offset,
                           exr_stream_error_func_ptr_t report) {
    (void)context;
    (void)report;
    struct exr_stream *stream = user;
    return (int64_t)image_source_read(stream->source, offset, buffer, (size_t)size);
}

static int64_t stream_size(exr_const_context_t context, void *user) {
    (void)context;
    struct exr_stream *stream = user;
    return (int64_t)stream->source->size;
}

static int64_t stream_write(exr_const_context_t context, void *user, const void *buffer, uint64_t size, uint64_t offset,
                            exr_stream_error_func_ptr_t report) {
    (void)context;
    (void)report;
    struct exr_stream *stream = user;
    uint64_t done = 0;
    while (done < size) {
        ssize_t wrote = pwrite(stream->fd, (const char *)buffer + done, (size_t)(size - done), (off_t)(offset + done));
        if (wrote < 0 && errno == EINTR)
            continue;
        if (wrote <= 0) {
            stream->io_error = wrote < 0 ? errno : EIO;
            return -1;
        }
        done += (uint64_t)wrote;
    }
    return (int64_t)done;
}

static exr_context_initializer_t initializer(struct exr_stream *stream, exr_error_handler_cb_t on_error) {
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    init.error_handler_fn = on_error;
    init.alloc_fn = limited_alloc;
    init.free_fn = mem_free;
    init.user_data = stream;
    init.read_fn = stream_read;
    init.size_fn = stream_size;
    init.write_fn = stream_write;
    init.max_image_width = init.max_image_height = IMAGE_MAX_SIDE;
    init.max_tile_width = init.max_tile_height = IMAGE_MAX_SIDE;
    init.zip_level = 4; /* twice as fast as zlib's default, for 0 to 3 % more bytes */
    /* A chunk table that was never written means an interrupted writer: refuse the file. */
    init.flags = EXR_CONTEXT_FLAG_DISABLE_CHUNK_RECONSTRUCTION;
    return init;
}

exr_context_initializer_t exr_stream_reader(struct exr_stream *stream) { return initializer(stream, note_error); }

exr_context_initializer_t exr_stream_writer(struct exr_stream *stream) { return initializer(stream, drop_error); }

enum status exr_stream_refuse(const struct exr_stream *stream, exr_result_t code, struct error *err) {
    return error_set(err, STATUS_INPUT, "%s: damaged EXR: %s", stream->source->name,
                     stream->message[0] ? stream->message : exr_get_default_error_message(code));
}
