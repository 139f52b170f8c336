/* folder.c -- see folder.h. */
#include "server/data/folder.h"

#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/data/layout.h"
#include "server/data/trash.h"

enum status folder_open(struct folder *f, const char *dir, void (*emptied)(void *user), void *user, struct error *err) {
    char *parts[] = {layout_trash(dir), layout_scenes(dir), layout_jobs(dir), layout_uploads(dir)};
    enum status status = STATUS_OK;
    *f = (struct folder){.dir = dir};
    pthread_mutex_init(&f->scene_mutex, NULL);
    for (size_t i = 0; i < sizeof parts / sizeof *parts; i++) {
        if (status == STATUS_OK)
            status = file_make_dirs(parts[i], err);
        mem_free(parts[i]);
    }
    return status == STATUS_OK ? trash_new(&f->trash, dir, emptied, user, err) : status;
}

void folder_close(struct folder *f) {
    if (!f->dir)
        return;
    trash_free(f->trash);
    pthread_mutex_destroy(&f->scene_mutex);
}

#define MIB ((uint64_t)1 << 20) /* bytes */

enum status folder_check_space(const struct folder *f, uint64_t keep, uint64_t bytes, struct error *err) {
    uint64_t room;
    enum status status = file_free_bytes(f->dir, &room, err);
    if (status != STATUS_OK || (room >= keep && room - keep >= bytes))
        return status;
    unsigned long long needed = (bytes + MIB - 1) / MIB, free_mib = room / MIB;
    if (keep > 0)
        error_set(err, STATUS_NO_SPACE,
                  "%llu MiB are needed, and of the %llu MiB that are free, %llu MiB are kept free", needed, free_mib,
                  (unsigned long long)(keep / MIB));
    else
        error_set(err, STATUS_NO_SPACE, "%llu MiB are needed, and %llu MiB are free", needed, free_mib);
    return error_hint(err, trash_is_busy(f->trash) ? "what was deleted is still being removed: try again in a moment"
                           : keep > 0
                               ? "delete jobs or scenes that nobody needs; an administrator can lower the options"
                                 " min_free_mib and admin_free_mib"
                               : "delete jobs or scenes that nobody needs");
}

/* --- the lock ------------------------------------------------------------------------------ */

#define TRIES 20 /* 50 ms each */

/* Takes the lock, with retries: a child that a killed daemon forked just before its end inherits the lock, and holds
 * it until it notices. */
static bool take(int fd) {
    for (int i = 0; flock(fd, LOCK_EX | LOCK_NB) != 0; i++) {
        if (errno != EWOULDBLOCK || i == TRIES)
            return false;
        usleep(50000);
    }
    return true;
}

enum status folder_lock(const char *dir, int *fd, struct error *err) {
    *fd = -1;
    umask(077);
    if (file_make_dirs(dir, err) != STATUS_OK)
        return error_hint(err, "--data DIR chooses another data folder");
    char *path = layout_lock(dir);
    char holder[32] = "";
    enum status status = STATUS_OK;
    *fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    if (*fd < 0) {
        status = error_set_errno(err, errno, "cannot open %s", path);
    } else if (!take(*fd)) {
        ssize_t got = errno == EWOULDBLOCK ? pread(*fd, holder, sizeof holder - 1, 0) : -1;
        holder[got > 0 ? strcspn(holder, "\n") : 0] = '\0';
        if (got >= 0)
            status = error_set(err, STATUS_CONFLICT, "the data folder %s already has a daemon (process %s)", dir,
                               *holder ? holder : "unknown");
        else
            status = error_set_errno(err, errno, "cannot lock %s", path);
    } else {
        int length = snprintf(holder, sizeof holder, "%ld\n", (long)getpid());
        if (ftruncate(*fd, 0) != 0 || pwrite(*fd, holder, (size_t)length, 0) != length)
            status = error_set_errno(err, errno, "cannot write %s", path);
    }
    mem_free(path);
    return status;
}

/* Whether it was open to others, and is closed now. Links are left alone: their targets are elsewhere. */
static bool close_one(const char *path, bool follow) {
    struct stat info;
    if ((follow ? stat(path, &info) : lstat(path, &info)) != 0 || S_ISLNK(info.st_mode) || (info.st_mode & 077) == 0)
        return false;
    if (chmod(path, info.st_mode & 0700) == 0)
        return true;
    log_warning("other users may look into %s, and its mode cannot be changed: %s", path, strerror(errno));
    return false;
}

void folder_close_to_others(const char *dir) {
    struct error err;
    char **names;
    size_t name_count, count = close_one(dir, true) ? 1 : 0;
    if (file_list(dir, &names, &name_count, &err) != STATUS_OK) {
        log_warning("%s", err.message);
        return;
    }
    for (size_t i = 0; i < name_count; i++) {
        char *path = file_join(dir, names[i]);
        count += close_one(path, false);
        mem_free(path);
    }
    file_free_names(names, name_count);
    if (count > 0)
        log_info("data folder %s: %zu of its files and folders were open to other users and are closed now", dir,
                 count);
}
