/* file.c -- see file.h. */
#include "common/file.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include "common/mem.h"

enum status file_read(const char *path, struct buf *out, struct error *err) {
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0)
        return error_set_errno(err, errno, "cannot open %s", path);
    enum status status = STATUS_OK;
    char chunk[65536];
    for (;;) {
        ssize_t got = read(fd, chunk, sizeof chunk);
        if (got < 0 && errno == EINTR)
            continue;
        if (got < 0) {
            status = error_set_errno(err, errno, "cannot read %s", path);
            break;
        }
        if (got == 0)
            break;
        if (!buf_append(out, chunk, (size_t)got)) {
            status = error_set(err, STATUS_LIMIT, "%s is larger than %zu bytes", path, out->limit);
            break;
        }
    }
    close(fd);
    return status;
}

enum status file_rename_new(const char *from, const char *to, struct error *err) {
    int failed = renameat2(AT_FDCWD, from, AT_FDCWD, to, RENAME_NOREPLACE) == 0 ? 0 : errno;
    if (failed == EINVAL || failed == ENOSYS) /* a file system that cannot, such as NFS */
        failed = link(from, to) != 0 ? errno : unlink(from) != 0 ? errno : 0;
    if (failed == EEXIST)
        return error_set(err, STATUS_CONFLICT, "%s is there already", to);
    return failed ? error_set_errno(err, failed, "cannot rename to %s", to) : STATUS_OK;
}

enum status file_write_all(int fd, const void *data, size_t length, const char *path, struct error *err) {
    const char *at = data;
    while (length > 0) {
        ssize_t wrote = write(fd, at, length);
        if (wrote < 0 && errno == EINTR)
            continue;
        if (wrote < 0)
            return error_set_errno(err, errno, "cannot write %s", path);
        at += wrote;
        length -= (size_t)wrote;
    }
    return STATUS_OK;
}

static char *parent_of(const char *path) {
    const char *slash = strrchr(path, '/');
    if (!slash)
        return mem_strdup(".");
    return slash == path ? mem_strdup("/") : mem_strndup(path, (size_t)(slash - path));
}

enum status file_sync_parent(const char *path, struct error *err) {
    char *dir = parent_of(path);
    enum status status = STATUS_OK;
    int fd = open(dir, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0 || fsync(fd) != 0)
        status = error_set_errno(err, errno, "cannot sync folder %s", dir);
    if (fd >= 0)
        close(fd);
    mem_free(dir);
    return status;
}

/* What both ways to replace a file end with: `status` tells whether the temporary one is whole. */
static enum status rename_synced(const char *temporary, const char *path, enum status status, struct error *err) {
    if (status == STATUS_OK && rename(temporary, path) != 0)
        status = error_set_errno(err, errno, "cannot rename to %s", path);
    if (status == STATUS_OK)
        status = file_sync_parent(path, err);
    else
        unlink(temporary);
    return status;
}

/* As mkostemp, but of the mode that the umask leaves: a confined worker cannot change it afterwards. */
static int create_temporary(char *name) {
    static const char letters[] = "abcdefghijklmnopqrstuvwxyz012345";
    char *end = name + strlen(name) - 6;
    for (int tries = 0; tries < 100; tries++) {
        unsigned char random[6];
        if (getrandom(random, sizeof random, 0) != (ssize_t)sizeof random)
            return -1;
        for (size_t i = 0; i < sizeof random; i++)
            end[i] = letters[random[i] % 32];
        int fd = open(name, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (fd >= 0 || errno != EEXIST)
            return fd;
    }
    return -1;
}

enum status file_replace(const char *path, const void *data, size_t length, struct error *err) {
    char *temporary = mem_printf("%s.tmp-XXXXXX", path);
    enum status status = STATUS_OK;
    int fd = create_temporary(temporary);
    if (fd < 0) {
        status = error_set_errno(err, errno, "cannot create a temporary file beside %s", path);
        goto out;
    }
    status = file_write_all(fd, data, length, path, err);
    if (status == STATUS_OK && fsync(fd) != 0)
        status = error_set_errno(err, errno, "cannot sync %s", path);
    if (close(fd) != 0 && status == STATUS_OK)
        status = error_set_errno(err, errno, "cannot close %s", path);
    status = rename_synced(temporary, path, status, err);
out:
    mem_free(temporary);
    return status;
}

enum status file_put_in_place(const char *temporary, const char *path, struct error *err) {
    int fd = open(temporary, O_RDONLY | O_CLOEXEC);
    enum status status = STATUS_OK;
    if (fd < 0 || fsync(fd) != 0)
        status = error_set_errno(err, errno, "cannot sync %s", path);
    if (fd >= 0)
        close(fd);
    return rename_synced(temporary, path, status, err);
}

enum status file_make_dirs(const char *path, struct error *err) {
    char *partial = mem_strdup(path);
    enum status status = STATUS_OK;
    for (char *at = partial + 1; status == STATUS_OK; at++) {
        if (*at != '/' && *at != '\0')
            continue;
        char kept = *at;
        *at = '\0';
        if (mkdir(partial, 0777) == 0)
            status = file_sync_parent(partial, err);
        else if (errno != EEXIST)
            status = error_set_errno(err, errno, "cannot create folder %s", partial);
        *at = kept;
        if (kept == '\0')
            break;
    }
    mem_free(partial);
    return status;
}

void file_free_names(char **names, size_t count) {
    for (size_t i = 0; i < count; i++)
        mem_free(names[i]);
    mem_free(names);
}

static int by_name(const void *a, const void *b) { return strcmp(*(char *const *)a, *(char *const *)b); }

/* As file_list, of an open folder. */
static enum status list(DIR *dir, const char *path, char ***names, size_t *count, struct error *err) {
    size_t capacity = 0;
    struct dirent *entry;
    *names = NULL;
    *count = 0;
    while ((void)(errno = 0), (entry = readdir(dir)) != NULL) {
        if (strcmp(entry->d_name, ".") == 0 || strcmp(entry->d_name, "..") == 0)
            continue;
        if (*count == capacity) {
            capacity = capacity ? 2 * capacity : 64;
            *names = mem_realloc_array(*names, capacity, sizeof **names);
        }
        (*names)[(*count)++] = mem_strdup(entry->d_name);
    }
    if (errno != 0) {
        enum status status = error_set_errno(err, errno, "cannot list all of folder %s", path);
        file_free_names(*names, *count);
        *names = NULL;
        *count = 0;
        return status;
    }
    if (*count > 1)
        qsort(*names, *count, sizeof **names, by_name);
    return STATUS_OK;
}

/* Opens the folder `name` of the folder `dir_fd` and lists it. */
static enum status open_folder(int dir_fd, const char *name, const char *path, DIR **dir, char ***names, size_t *count,
                               struct error *err) {
    int fd = openat(dir_fd, name, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    *dir = fd >= 0 ? fdopendir(fd) : NULL;
    if (!*dir) {
        enum status status = error_set_errno(err, errno, "cannot open folder %s", path);
        if (fd >= 0)
            close(fd);
        return status;
    }
    enum status status = list(*dir, path, names, count, err);
    if (status != STATUS_OK)
        closedir(*dir);
    return status;
}

enum status file_list(const char *path, char ***names, size_t *count, struct error *err) {
    DIR *dir = opendir(path);
    *names = NULL;
    *count = 0;
    if (!dir)
        return error_set_errno(err, errno, "cannot open folder %s", path);
    enum status status = list(dir, path, names, count, err);
    closedir(dir);
    return status;
}

enum status file_list_numbered(const char *dir, int (*number_of)(const char *name), int **numbers, size_t *count,
                               struct error *err) {
    char **names = NULL;
    size_t name_count = 0;
    *count = 0;
    enum status status = file_list(dir, &names, &name_count, err);
    *numbers = mem_array(name_count + 1, sizeof **numbers);
    for (size_t i = 0; status == STATUS_OK && i < name_count; i++) {
        int number = number_of(names[i]);
        size_t at = number > 0 ? (*count)++ : 0;
        for (; number > 0 && at > 0 && (*numbers)[at - 1] > number; at--)
            (*numbers)[at] = (*numbers)[at - 1];
        if (number > 0)
            (*numbers)[at] = number;
    }
    file_free_names(names, name_count);
    return status;
}

bool file_path_is_plain(const char *path) {
    for (const char *at = path;; at++) {
        size_t length = strcspn(at, "/");
        if (length == 0 || (length == 1 && at[0] == '.') || (length == 2 && memcmp(at, "..", 2) == 0))
            return false;
        at += length;
        if (*at == '\0')
            return true;
    }
}

/* Removes what `name` is inside the folder `dir_fd`. `path` is for messages. */
static enum status remove_at(int dir_fd, const char *name, const char *path, struct error *err) {
    char **names;
    size_t count;
    DIR *dir;
    if (unlinkat(dir_fd, name, 0) == 0 || errno == ENOENT)
        return STATUS_OK;
    if (errno != EISDIR && errno != EPERM)
        return error_set_errno(err, errno, "cannot remove %s", path);
    enum status status = open_folder(dir_fd, name, path, &dir, &names, &count, err);
    if (status != STATUS_OK)
        return status == STATUS_NOT_FOUND ? STATUS_OK : status;
    for (size_t i = 0; status == STATUS_OK && i < count; i++) {
        char *inner = file_join(path, names[i]);
        status = remove_at(dirfd(dir), names[i], inner, err);
        mem_free(inner);
    }
    file_free_names(names, count);
    closedir(dir);
    if (status == STATUS_OK && unlinkat(dir_fd, name, AT_REMOVEDIR) != 0 && errno != ENOENT)
        status = error_set_errno(err, errno, "cannot remove folder %s", path);
    return status;
}

enum status file_remove_tree(const char *path, struct error *err) { return remove_at(AT_FDCWD, path, path, err); }

/* Adds what `name` is inside the folder `dir_fd`. `path` is for messages. */
static enum status add_size(int dir_fd, const char *name, const char *path, uint64_t *files, uint64_t *bytes,
                            struct error *err) {
    struct stat info;
    char **names;
    size_t count;
    DIR *dir;
    if (fstatat(dir_fd, name, &info, AT_SYMLINK_NOFOLLOW) != 0)
        return errno == ENOENT ? STATUS_OK : error_set_errno(err, errno, "cannot access %s", path);
    if (S_ISREG(info.st_mode)) {
        ++*files;
        *bytes += (uint64_t)info.st_blocks * 512;
    }
    if (!S_ISDIR(info.st_mode))
        return STATUS_OK;
    enum status status = open_folder(dir_fd, name, path, &dir, &names, &count, err);
    if (status != STATUS_OK)
        return status == STATUS_NOT_FOUND ? STATUS_OK : status;
    for (size_t i = 0; status == STATUS_OK && i < count; i++) {
        char *inner = file_join(path, names[i]);
        status = add_size(dirfd(dir), names[i], inner, files, bytes, err);
        mem_free(inner);
    }
    file_free_names(names, count);
    closedir(dir);
    return status;
}

enum status file_tree_size(const char *path, uint64_t *files, uint64_t *bytes, struct error *err) {
    *files = *bytes = 0;
    return add_size(AT_FDCWD, path, path, files, bytes, err);
}

enum status file_free_bytes(const char *path, uint64_t *bytes, struct error *err) {
    struct statvfs info;
    if (statvfs(path, &info) != 0)
        return error_set_errno(err, errno, "cannot ask how full the disk of %s is", path);
    *bytes = (uint64_t)info.f_bavail * (uint64_t)info.f_frsize;
    return STATUS_OK;
}

bool file_is_in(const char *dir, const char *name) {
    char *path = file_join(dir, name);
    bool found = access(path, F_OK) == 0 || (errno != ENOENT && errno != ENOTDIR && errno != ENAMETOOLONG);
    mem_free(path);
    return found;
}

char *file_join(const char *dir, const char *name) {
    size_t length = strlen(dir);
    return mem_printf("%s%s%s", dir, length && dir[length - 1] == '/' ? "" : "/", name);
}
