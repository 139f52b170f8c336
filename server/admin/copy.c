/* copy.c -- see copy.h. */
#include "server/admin/copy.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/fs.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/utf8.h"

#define CHUNK_BYTES ((size_t)1 << 20) /* copied at once */

bool copy_path_is_plain(const char *path) { return utf8_is_name(path) && file_path_is_plain(path); }

static bool give(const struct copy *c, int fd) { return c->owner == (uid_t)-1 || fchown(fd, c->owner, c->group) == 0; }

/* Opens the folder of `path` below the folder `root`, creating it if `makes`; *base is the last part. -1 with errno. */
static int open_parent(const struct copy *c, int root, const char *path, bool makes, const char **base) {
    int fd = fcntl(root, F_DUPFD_CLOEXEC, 0);
    for (const char *slash; fd >= 0 && (slash = strchr(path, '/')) != NULL; path = slash + 1) {
        char *part = mem_strndup(path, (size_t)(slash - path));
        bool is_made = makes && mkdirat(fd, part, 0750) == 0;
        int inner = openat(fd, part, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC), number = errno;
        mem_free(part);
        close(fd);
        fd = inner;
        errno = number;
        if (fd >= 0 && is_made && !give(c, fd)) {
            number = errno;
            close(fd);
            fd = -1;
            errno = number;
        }
    }
    *base = path;
    return fd;
}

static bool copy_bytes(int in, int out) {
    char *chunk = mem_alloc(CHUNK_BYTES);
    ssize_t got;
    bool is_whole = true;
    while (is_whole && (got = read(in, chunk, CHUNK_BYTES)) != 0)
        is_whole = got > 0 ? file_write_all(out, chunk, (size_t)got, "", NULL) == STATUS_OK : errno == EINTR;
    int number = errno;
    mem_free(chunk);
    errno = number;
    return is_whole;
}

/* Writes the content of `in` to a new file `base` in the folder `to`. False with errno. */
static bool fill(struct copy *c, int in, const struct stat *info, int to, const char *base) {
    char self[40];
    snprintf(self, sizeof self, "/proc/self/fd/%d", in);
    int out = openat(to, base, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600);
    if (out < 0)
        return false;
    bool is_shared = ioctl(out, FICLONE, in) == 0;
    if (!is_shared && c->may_link) {
        char *name = mem_printf("%s.link", base);
        is_shared = linkat(AT_FDCWD, self, to, name, AT_SYMLINK_FOLLOW) == 0;
        bool is_linked = is_shared && renameat(to, name, to, base) == 0;
        mem_free(name);
        if (is_linked) {
            close(out);
            c->shared_count++;
            return true;
        }
        is_shared = false;
    }
    const struct timespec times[2] = {info->st_atim, info->st_mtim};
    bool is_good = (is_shared || copy_bytes(in, out)) && give(c, out) && fchmod(out, info->st_mode & 0777) == 0 &&
                   futimens(out, times) == 0;
    c->shared_count += is_shared;
    int number = errno;
    close(out);
    errno = number;
    return is_good;
}

static bool is_same(const struct stat *a, const struct stat *b) {
    return (a->st_dev == b->st_dev && a->st_ino == b->st_ino) ||
           (a->st_size == b->st_size && a->st_mtim.tv_sec == b->st_mtim.tv_sec &&
            a->st_mtim.tv_nsec == b->st_mtim.tv_nsec);
}

enum status copy_file(struct copy *c, const char *path, bool *exists, struct error *err) {
    const char *base;
    struct stat info, present;
    enum status status = STATUS_OK;
    int in = -1, to = -1, from = open_parent(c, c->from, path, false, &base);
    *exists = false;
    if (from >= 0)
        in = openat(from, base, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    if (in < 0) {
        if (errno != ENOENT && errno != ELOOP && errno != ENOTDIR && errno != ENXIO)
            status = error_set_errno(err, errno, "cannot open %s", path);
        goto out;
    }
    if (fstat(in, &info) != 0) {
        status = error_set_errno(err, errno, "cannot access %s", path);
        goto out;
    }
    if (!S_ISREG(info.st_mode))
        goto out;
    *exists = true;
    to = open_parent(c, c->to, path, true, &base);
    if (to >= 0 && fstatat(to, base, &present, AT_SYMLINK_NOFOLLOW) == 0) {
        if (is_same(&info, &present))
            goto out;
        unlinkat(to, base, 0);
    }
    if (to < 0 || !fill(c, in, &info, to, base)) {
        status = error_set_errno(err, errno, "cannot copy %s", path);
        goto out;
    }
    c->file_count++;
    c->byte_count += (uint64_t)info.st_size;
out:
    if (to >= 0)
        close(to);
    if (in >= 0)
        close(in);
    if (from >= 0)
        close(from);
    return status;
}

enum status copy_tree(struct copy *c, const char *path, struct error *err) {
    char **names, *inside = mem_printf("%s/x", path);
    size_t count;
    bool exists;
    const char *base;
    int fd = open_parent(c, c->from, inside, false, &base);
    mem_free(inside);
    if (fd < 0)
        return errno == ENOENT || errno == ELOOP || errno == ENOTDIR
                   ? STATUS_OK
                   : error_set_errno(err, errno, "cannot open %s", path);
    char self[40];
    snprintf(self, sizeof self, "/proc/self/fd/%d", fd);
    enum status status = file_list(self, &names, &count, err);
    for (size_t i = 0; status == STATUS_OK && i < count; i++) {
        struct stat info;
        char *inner = file_join(path, names[i]);
        if (!utf8_is_name(names[i]) || fstatat(fd, names[i], &info, AT_SYMLINK_NOFOLLOW) != 0)
            ; /* gone, or not made by us */
        else if (S_ISDIR(info.st_mode))
            status = copy_tree(c, inner, err);
        else
            status = copy_file(c, inner, &exists, err);
        mem_free(inner);
    }
    file_free_names(names, count);
    close(fd);
    return status;
}
