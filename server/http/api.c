/* api.c -- see api.h. */
#include "server/http/api.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/http/digests.h"
#include "server/http/events.h"
#include "server/http/field.h"
#include "server/http/partial.h"
#include "server/http/problem.h"
#include "server/http/tally.h"

#define RESERVE_BYTES ((uint64_t)16 << 20)
#define RESERVE_BYTES_MIN ((uint64_t)256 << 10)

static const char *const folders[] = {
    [STORE_FILES_SCENE] = "scenes", [STORE_FILES_JOB] = "jobs", [STORE_FILES_UPLOAD] = "uploads"};

/* Removes what is in DATA/folder: all of it, or (kind not NULL) what the store has no row for. */
static enum status sweep(const struct api *api, const char *folder, const enum store_files *kind,
                         struct error *err) {
    char *path = file_join(api->config.data_dir, folder);
    enum status status = file_make_dirs(path, err);
    DIR *dir = status == STATUS_OK ? opendir(path) : NULL;
    if (status == STATUS_OK && !dir)
        status = error_set_errno(err, errno, "cannot list folder %s", path);
    struct dirent *entry;
    while (status == STATUS_OK && (entry = readdir(dir)) != NULL) {
        if (strcmp(entry->d_name, ".") == 0 || strcmp(entry->d_name, "..") == 0 ||
            (kind && store_has_files(api->store, *kind, entry->d_name)))
            continue;
        char *inner = file_join(path, entry->d_name);
        log_info("removing %s, left over from an earlier run", inner);
        status = file_remove_tree(inner, err);
        mem_free(inner);
    }
    if (dir)
        closedir(dir);
    mem_free(path);
    return status;
}

enum status api_new(struct api **out, const struct api_config *config, struct store *store,
                    struct scheduler *scheduler, struct error *err) {
    struct api *api = mem_calloc(1, sizeof *api);
    api->config = *config;
    api->store = store;
    api->scheduler = scheduler;
    pthread_mutex_init(&api->scene_mutex, NULL);
    api->tally = tally_new();
    api->hub = hub_new(config->keepalive_sec);
    api->digests = digests_new();
    api->partials = partials_new(api);
    *out = api;
    enum status status = store_keep(store, config->scene_keep_ms, config->job_keep_ms,
                                    config->upload_keep_ms, err);
    if (status == STATUS_OK)
        status = partials_recover(api->partials, err);
    if (status == STATUS_OK)
        status = sweep(api, "trash", NULL, err);
    for (size_t i = 0; i < sizeof folders / sizeof *folders && status == STATUS_OK; i++) {
        enum store_files kind = (enum store_files)i;
        status = sweep(api, folders[i], &kind, err);
    }
    api_renew_reserve(api);
    if (status == STATUS_OK) {
        store_on_change(store, hub_changed, api->hub);
        return STATUS_OK;
    }
    api_free(api);
    *out = NULL;
    return status;
}

void api_free(struct api *api) {
    if (!api)
        return;
    store_on_change(api->store, NULL, NULL);
    partials_free(api->partials);
    hub_free(api->hub);
    tally_free(api->tally);
    digests_free(api->digests);
    pthread_mutex_destroy(&api->scene_mutex);
    mem_free(api);
}

bool api_spend_reserve(struct api *api) {
    char *path = file_join(api->config.data_dir, "reserve");
    bool spent = unlink(path) == 0;
    if (spent)
        log_warning("the disk is full: %s was given up so that something can be removed", path);
    mem_free(path);
    return spent;
}

void api_renew_reserve(struct api *api) {
    char *path = file_join(api->config.data_dir, "reserve");
    uint64_t room = 0;
    /* Not all that there is: others need it more. */
    if (access(path, F_OK) != 0 && file_free_bytes(api->config.data_dir, &room, NULL) == STATUS_OK &&
        room / 8 >= RESERVE_BYTES_MIN) {
        uint64_t bytes = room / 8 < RESERVE_BYTES ? room / 8 : RESERVE_BYTES;
        int fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
        bool done = fd >= 0 && posix_fallocate(fd, 0, (off_t)bytes) == 0;
        if (fd >= 0)
            close(fd);
        if (fd >= 0 && !done)
            unlink(path);
    }
    mem_free(path);
}

enum status api_discard(struct api *api, const char *path, struct error *err) {
    char *from = file_join(api->config.data_dir, path);
    char *to = file_join(api->config.data_dir, "trash/XXXXXX");
    enum status status = STATUS_OK;
    /* Into a folder of its own, so that two discards of one name do not meet. */
    if (!mkdtemp(to)) {
        if (errno == ENOSPC || errno == EDQUOT) /* removing must work on a full disk */
            status = file_remove_tree(from, err);
        else
            status = error_set_errno(err, errno, "cannot make a folder in %s/trash", api->config.data_dir);
        goto out;
    }
    char *inside = file_join(to, "it");
    if (rename(from, inside) != 0 && errno != ENOENT)
        status = error_set_errno(err, errno, "cannot move %s away", from);
    mem_free(inside);
    enum status removed = file_remove_tree(to, status == STATUS_OK ? err : NULL);
    if (status == STATUS_OK)
        status = removed;
out:
    mem_free(from);
    mem_free(to);
    api_renew_reserve(api);
    return status;
}

struct response *api_check_room(struct api *api, const struct request *r, uint64_t bytes) {
    struct error err;
    uint64_t room;
    if (file_free_bytes(api->config.data_dir, &room, &err) != STATUS_OK)
        return problem_from(r, &err);
    uint64_t keep = api->config.min_free_bytes;
    if (room >= keep && room - keep >= bytes)
        return NULL;
    char detail[256];
    snprintf(detail, sizeof detail,
             "%llu MiB are wanted, and of the %llu MiB that are free, %llu MiB must stay so",
             (unsigned long long)(bytes >> 20), (unsigned long long)(room >> 20),
             (unsigned long long)(keep >> 20));
    return problem_full(r, 507, detail, "delete jobs or scenes that nobody needs", NULL);
}

struct response *api_check_share(struct api *api, const struct request *r, uint64_t bytes) {
    struct error err;
    uint64_t kept, limit = api->config.user_max_bytes;
    if (limit == 0 || r->caller.user_id == 0)
        return NULL;
    if (store_user_bytes(api->store, r->caller.user_id, &kept, &err) != STATUS_OK)
        return problem_from(r, &err);
    if (kept < limit && bytes <= limit - kept)
        return NULL;
    char detail[256];
    snprintf(detail, sizeof detail, "your scenes and outputs take %llu MiB, %llu MiB are wanted, and %llu MiB are "
             "what a user may keep", (unsigned long long)(kept >> 20), (unsigned long long)(bytes >> 20),
             (unsigned long long)(limit >> 20));
    return problem_full(r, 507, detail, "delete jobs or scenes that you do not need", NULL);
}
