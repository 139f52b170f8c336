/* job_file.c -- see job_file.h. */
#include "server/data/job_file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"

enum status job_file_open(const char *data_dir, const char *path, int *out, struct error *err) {
    char *root = file_join(data_dir, "jobs");
    int fd = open(root, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    mem_free(root);
    for (const char *at = path; fd >= 0 && *at;) {
        char part[256];
        size_t length = strcspn(at, "/");
        bool is_last = at[length] == '\0';
        int next = -1;
        if (length < sizeof part) {
            snprintf(part, sizeof part, "%.*s", (int)length, at);
            next = openat(fd, part, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC |
                          (is_last ? 0 : O_DIRECTORY));
        } else {
            errno = ENAMETOOLONG;
        }
        int number = errno;
        close(fd);
        errno = number;
        fd = next;
        at += length + (is_last ? 0 : 1);
    }
    *out = fd;
    return fd >= 0 ? STATUS_OK : error_set_errno(err, errno, "cannot open jobs/%s", path);
}
