/* file_stream.h -- a part of an open file as the body of a reply, read ahead on threads that may block. */
#ifndef UNBAKE_TRANSPORT_FILE_STREAM_H
#define UNBAKE_TRANSPORT_FILE_STREAM_H

#include <stdint.h>

#include "server/transport/message.h"

/* `length` bytes of fd from `offset` on; takes fd. If the file has become shorter, the stream ends early. */
struct stream *file_stream_new(int fd, uint64_t offset, uint64_t length);

#endif
