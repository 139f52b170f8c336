/* exr_stream.h -- OpenEXRCore's access to files and memory, for exr_read.c, exr_write.c and exr_check.c; private to
 * them. */
#ifndef UNBAKE_COMMON_EXR_STREAM_H
#define UNBAKE_COMMON_EXR_STREAM_H

#include <openexr.h>

#include "common/image_codec.h"

/* State reachable from the library's callbacks. */
struct exr_stream {
    struct image_source *source; /* reading */
    int fd;                      /* writing */
    int io_error;                /* errno of the first refused write */
    char message[256];           /* reading: the library's first error message */
};

/* Copies text of the file for a message; non-ASCII bytes become "?". */
const char *exr_stream_printable(const char *text, char *out, size_t size);

/* For exr_start_read of stream->source. */
exr_context_initializer_t exr_stream_reader(struct exr_stream *stream);
/* For exr_start_write to stream->fd. */
exr_context_initializer_t exr_stream_writer(struct exr_stream *stream);

/* STATUS_INPUT with the library's message. */
enum status exr_stream_refuse(const struct exr_stream *stream, exr_result_t code, struct error *err);

#endif
