/* mapping.c -- see mapping.h. */
#include "server/ingest/mapping.h"

#include <errno.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

enum status mapping_open(struct mapping *m, const char *path, const char *name, const char *kind, struct error *err) {
    enum status status = STATUS_OK;
    struct stat info;
    *m = (struct mapping){0};
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0)
        return error_set_errno(err, errno, "cannot open %s", name);
    if (fstat(fd, &info) != 0) {
        status = error_set_errno(err, errno, "cannot ask for the size of %s", name);
    } else if (!S_ISREG(info.st_mode) || info.st_size == 0) {
        status = error_set(err, STATUS_INPUT, "%s is not %s: it is %s", name, kind,
                           S_ISREG(info.st_mode) ? "empty" : "no regular file");
    } else {
        m->size = (size_t)info.st_size;
        m->data = mmap(NULL, m->size, PROT_READ, MAP_PRIVATE, fd, 0);
        if (m->data == MAP_FAILED) {
            status = error_set_errno(err, errno, "cannot map %s", name);
            *m = (struct mapping){0};
        }
    }
    close(fd);
    return status;
}

void mapping_close(struct mapping *m) {
    if (m->data && !m->is_borrowed)
        munmap(m->data, m->size);
    *m = (struct mapping){0};
}
