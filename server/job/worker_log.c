/* worker_log.c -- see worker_log.h. */
#include "server/job/worker_log.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"

#define LOG_KEEP 65536      /* bytes kept of earlier attempts when the log has passed LOG_LARGE */
#define LOG_LARGE (1 << 20) /* bytes */

/* Cuts the log to its tail once it is large. */
static enum status trim_log(const char *path, int fd, struct error *err) {
    off_t length = lseek(fd, 0, SEEK_END);
    if (length < LOG_LARGE)
        return STATUS_OK;
    char *tail = mem_alloc(LOG_KEEP);
    ssize_t got = pread(fd, tail, LOG_KEEP, length - LOG_KEEP);
    enum status status = STATUS_OK;
    if (got < 0 || ftruncate(fd, 0) != 0)
        status = error_set_errno(err, errno, "cannot truncate %s", path);
    else
        status = file_write_all(fd, tail, (size_t)got, path, err);
    mem_free(tail);
    return status;
}

enum status worker_log_open(const char *path, int *fd, off_t *start, struct error *err) {
    *start = 0;
    *fd = open(path, O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (*fd < 0)
        return error_set_errno(err, errno, "cannot open %s", path);
    enum status status = trim_log(path, *fd, err);
    if (status == STATUS_OK)
        *start = lseek(*fd, 0, SEEK_END);
    else {
        close(*fd);
        *fd = -1;
    }
    return status;
}

enum status worker_log_take(const char *path, const char *from, size_t limit, struct error *err) {
    off_t start;
    int fd = -1, log = -1;
    fd = open(from, O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
    if (fd < 0)
        return errno == ENOENT ? STATUS_OK : error_set_errno(err, errno, "cannot open %s", from);
    char *text = mem_alloc(limit);
    ssize_t got = pread(fd, text, limit, 0);
    enum status status = got < 0 ? error_set_errno(err, errno, "cannot read %s", from) : STATUS_OK;
    if (status == STATUS_OK)
        status = worker_log_open(path, &log, &start, err);
    if (status == STATUS_OK)
        status = file_write_all(log, text, (size_t)got, path, err);
    if (status == STATUS_OK && unlink(from) != 0)
        status = error_set_errno(err, errno, "cannot remove %s", from);
    if (log >= 0)
        close(log);
    close(fd);
    mem_free(text);
    return status;
}

char *worker_log_tail(const char *path, off_t start, size_t limit) {
    char *text = mem_calloc(limit + 1, 1);
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
    if (fd < 0)
        return text;
    off_t end = lseek(fd, 0, SEEK_END);
    bool whole = end - start <= (off_t)limit;
    if (!whole)
        start = end - (off_t)limit;
    ssize_t got = end > start ? pread(fd, text, (size_t)(end - start), start) : 0;
    close(fd);
    size_t length = got > 0 ? (size_t)got : 0;
    text[length] = '\0';
    if (!whole) { /* start at a whole line if there is one */
        char *newline = memchr(text, '\n', length);
        if (newline && newline[1]) {
            length -= (size_t)(newline + 1 - text);
            memmove(text, newline + 1, length + 1);
        }
    }
    while (length > 0 && (text[length - 1] == '\n' || text[length - 1] == ' '))
        text[--length] = '\0';
    for (size_t i = 0; i < length; i++) {
        unsigned char c = (unsigned char)text[i];
        if (c < 0x20 || c >= 0x7f) /* the text goes into JSON and terminals: ASCII only */
            text[i] = c == '\n' ? ' ' : '?';
    }
    return text;
}
