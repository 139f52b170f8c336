/* image_codec.c -- see image_codec.h. */
#include "common/image_codec.h"

#include <errno.h>
#include <string.h>
#include <unistd.h>

const char *const image_rgba[4] = {"R", "G", "B", "A"};

size_t image_source_read(struct image_source *source, uint64_t offset, void *buffer,
                         size_t length) {
    if (offset >= source->size)
        return 0;
    if (length > source->size - offset)
        length = (size_t)(source->size - offset);
    if (source->memory) {
        memcpy(buffer, source->memory + offset, length);
        return length;
    }
    size_t done = 0;
    while (done < length) {
        ssize_t got = pread(source->fd, (char *)buffer + done, length - done,
                            (off_t)(offset + done));
        if (got < 0 && errno == EINTR)
            continue;
        if (got < 0 && source->io_error == 0)
            source->io_error = errno;
        if (got <= 0)
            break;
        done += (size_t)got;
    }
    return done;
}
