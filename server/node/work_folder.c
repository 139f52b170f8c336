/* work_folder.c -- see work_folder.h. */
#include "server/node/work_folder.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"

#define PREFIX "unbake-attempt-"
#define YOUNG_SEC 60 /* one that is so new may be about to be locked */

/* Removes the folder if it is this user's and nobody works there. */
static void remove_stale(const char *path) {
    struct stat info;
    struct error err;
    int fd = open(path, O_RDONLY | O_DIRECTORY | O_CLOEXEC | O_NOFOLLOW);
    if (fd < 0)
        return;
    if (fstat(fd, &info) == 0 && info.st_uid == geteuid() && time(NULL) - info.st_ctime > YOUNG_SEC &&
        flock(fd, LOCK_EX | LOCK_NB) == 0 && file_remove_tree(path, &err) != STATUS_OK)
        log_warning("%s", err.message);
    close(fd);
}

static void remove_all_stale(const char *base) {
    char **names = NULL;
    size_t count = 0;
    (void)file_list(base, &names, &count, NULL);
    for (size_t i = 0; i < count; i++)
        if (strncmp(names[i], PREFIX, strlen(PREFIX)) == 0) {
            char *path = file_join(base, names[i]);
            remove_stale(path);
            mem_free(path);
        }
    file_free_names(names, count);
}

enum status work_folder_make(struct work_folder *folder, const char *base, struct error *err) {
    *folder = (struct work_folder){.lock_fd = -1};
    enum status status = file_make_dirs(base, err);
    if (status != STATUS_OK)
        return status;
    remove_all_stale(base);
    char *path = file_join(base, PREFIX "XXXXXX");
    if (!mkdtemp(path)) {
        status = error_set_errno(err, errno, "cannot make a folder in %s", base);
        mem_free(path);
        return status;
    }
    folder->path = path;
    folder->lock_fd = open(path, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (folder->lock_fd < 0 || flock(folder->lock_fd, LOCK_EX | LOCK_NB) != 0)
        status = error_set_errno(err, errno, "cannot lock %s", path);
    return status;
}

void work_folder_remove(struct work_folder *folder) {
    struct error err;
    if (folder->path && file_remove_tree(folder->path, &err) != STATUS_OK)
        log_warning("%s", err.message);
    if (folder->lock_fd >= 0)
        close(folder->lock_fd);
    mem_free(folder->path);
    *folder = (struct work_folder){.lock_fd = -1};
}
