/* work_file.c -- see work_file.h. */
#include "server/data/work_file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/data/layout.h"

#define TRUTH_DEPTH_MAX 16 /* folders; deeper ones no bundle has */

/* Opens `path`, which is relative to the data folder and begins with the name of the folder `root` (taken): jobs/ or
 * scenes/. That folder itself may be a link: only an administrator can have made it. */
static enum status open_in(char *root, const char *path, int *out, struct error *err) {
    int fd = open(root, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    mem_free(root);
    for (const char *at = strchr(path, '/') + 1; fd >= 0 && *at;) {
        char part[256];
        size_t length = strcspn(at, "/");
        bool is_last = at[length] == '\0';
        int next = -1;
        if (length < sizeof part) {
            snprintf(part, sizeof part, "%.*s", (int)length, at);
            next = openat(fd, part, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC | (is_last ? 0 : O_DIRECTORY));
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
    return fd >= 0 ? STATUS_OK : error_set_errno(err, errno, "cannot open %s", path);
}

enum status work_file_open_output(const char *data_dir, int64_t job_id, int attempt, const char *name, int *fd,
                                  struct error *err) {
    char *folder = layout_attempt(NULL, job_id, attempt), *path = layout_output(folder, name);
    enum status status = open_in(layout_jobs(data_dir), path, fd, err);
    mem_free(path);
    mem_free(folder);
    return status;
}

enum status work_file_open_log(const char *data_dir, int64_t job_id, int *fd, struct error *err) {
    char *folder = layout_job(NULL, job_id), *path = layout_log(folder);
    enum status status = open_in(layout_jobs(data_dir), path, fd, err);
    mem_free(path);
    mem_free(folder);
    return status;
}

enum status work_file_open_preview(const char *data_dir, const char *scene_id, const char *name, int *fd,
                                   struct error *err) {
    char *folder = layout_scene(NULL, scene_id), *path = layout_preview(folder, name);
    enum status status = open_in(layout_scenes(data_dir), path, fd, err);
    mem_free(path);
    mem_free(folder);
    return status;
}

enum status work_file_open_scene(const char *data_dir, const char *scene_id, const char *name, int *fd,
                                 struct error *err) {
    char *scene = layout_scene(NULL, scene_id), *folder = layout_files(scene), *path = file_join(folder, name);
    enum status status = open_in(layout_scenes(data_dir), path, fd, err);
    mem_free(path);
    mem_free(folder);
    mem_free(scene);
    return status;
}

enum status work_file_open_job_file(const char *data_dir, int64_t job_id, const char *name, int *fd,
                                    struct error *err) {
    char *folder = layout_job_files(NULL, job_id), *path = file_join(folder, name);
    enum status status = open_in(layout_jobs(data_dir), path, fd, err);
    mem_free(path);
    mem_free(folder);
    return status;
}

enum status work_file_open_checkpoint(const char *data_dir, int64_t job_id, int attempt, const char *name, int *fd,
                                      struct error *err) {
    char *dir = layout_attempt(NULL, job_id, attempt), *folder = layout_checkpoint_folder(dir);
    char *path = file_join(folder, name);
    enum status status = open_in(layout_jobs(data_dir), path, fd, err);
    mem_free(path);
    mem_free(folder);
    mem_free(dir);
    return status;
}

bool work_file_has_truth(const char *data_dir, const char *scene_id) {
    char *folder = layout_scene(data_dir, scene_id), *at = layout_files(folder);
    bool has = false;
    for (int depth = 0; depth < TRUTH_DEPTH_MAX && at && !has; depth++) {
        char *path = layout_truth(at), **names = NULL, *inner = NULL;
        size_t count = 0;
        struct stat info;
        has = lstat(path, &info) == 0 && S_ISREG(info.st_mode);
        /* an archive of one folder: as ingest/bundle.h has it */
        if (!has && file_list(at, &names, &count, NULL) == STATUS_OK && count == 1)
            inner = file_join(at, names[0]);
        file_free_names(names, count);
        mem_free(path);
        mem_free(at);
        at = inner;
    }
    mem_free(at);
    mem_free(folder);
    return has;
}
