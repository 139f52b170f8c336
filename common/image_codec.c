/* image_codec.c -- see image_codec.h. */
#include "common/image_codec.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

const char *const image_rgba[4] = {"R", "G", "B", "A"};

enum status image_source_open(struct image_source *source, const char *path, struct error *err) {
    struct stat facts;
    enum status status = STATUS_OK;
    /* Without O_NONBLOCK a FIFO under a picture's name would block for ever. */
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0)
        return error_set_errno(err, errno, "cannot open %s", path);
    if (fstat(fd, &facts) != 0)
        status = error_set_errno(err, errno, "cannot read %s", path);
    else if (!S_ISREG(facts.st_mode))
        status = error_set(err, STATUS_INPUT, "%s: not a regular file", path);
    else
        *source = (struct image_source){.name = path, .fd = fd, .size = (uint64_t)facts.st_size};
    if (status != STATUS_OK)
        close(fd);
    return status;
}

void image_source_close(struct image_source *source) {
    close(source->fd);
}

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
