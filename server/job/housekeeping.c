/* housekeeping.c -- see housekeeping.h. */
#include "server/job/housekeeping.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/data/attempt_cleanup.h"
#include "server/data/attempt_folder.h"
#include "server/data/layout.h"
#include "server/job/disk_usage.h"
#include "server/store/remote.h"

#define RUNNING_MAX 10000 /* attempts that an earlier daemon may have left running */

/* Temporary names as file_replace and file_put_in_place make them. */
static bool is_temporary(const char *name) {
    static const char part[] = ".part", temporary[] = ".tmp-";
    size_t length = strlen(name), random = 6;
    return (length > sizeof part - 1 && strcmp(name + length - (sizeof part - 1), part) == 0) ||
           (length > sizeof temporary - 1 + random &&
            memcmp(name + length - random - (sizeof temporary - 1), temporary, sizeof temporary - 1) == 0);
}

static void drop_temporary(const char *dir, bool and_below) {
    struct error err;
    char **names;
    size_t count;
    if (file_list(dir, &names, &count, &err) != STATUS_OK && err.status != STATUS_NOT_FOUND)
        log_warning("%s", err.message);
    for (size_t i = 0; i < count; i++) {
        char *path = file_join(dir, names[i]);
        struct stat info;
        bool is_there = lstat(path, &info) == 0;
        if (is_there && S_ISDIR(info.st_mode) && and_below)
            drop_temporary(path, true);
        else if (is_there && S_ISREG(info.st_mode) && is_temporary(names[i]) && unlink(path) != 0)
            log_warning("cannot remove %s: %s", path, strerror(errno));
        mem_free(path);
    }
    file_free_names(names, count);
}

void housekeeping_drop_temporary(const char *dir) {
    char *out = layout_out(dir);
    drop_temporary(dir, false);
    drop_temporary(out, true);
    mem_free(out);
}

void housekeeping_clean_job(const char *data_dir, struct store *store, int64_t job_id, int ended) {
    struct error err;
    if (attempt_cleanup(data_dir, store, job_id, ended, &err) != STATUS_OK)
        log_warning("job %lld: what its attempts have left over stays: %s", (long long)job_id, err.message);
}

void housekeeping_after_kill(const struct scheduler_config *config, struct store *store) {
    struct running *list = mem_array(RUNNING_MAX, sizeof *list);
    size_t count = 0;
    struct error err;
    if (store_job_running(store, RUNNING_MAX, list, &count, &err) != STATUS_OK)
        log_warning("what killed jobs left cannot be removed: %s", err.message);
    for (size_t i = 0; i < count; i++) {
        struct remote_row row;
        const struct attempt_key *key = &list[i].key;
        char *dir = layout_attempt(config->data_dir, key->job_id, key->number);
        enum status status = key->number ? store_remote_get(store, key->job_id, key->number, &row, &err) : STATUS_OK;
        if (status == STATUS_NOT_FOUND) {
            housekeeping_drop_temporary(dir);
            housekeeping_clean_job(config->data_dir, store, key->job_id, key->number);
        } else if (status != STATUS_OK) { /* what runs elsewhere goes on, and writes */
            log_warning("what killed jobs left cannot be removed: %s", err.message);
        }
        mem_free(dir);
    }
    mem_free(list);
}

/* If this is interrupted, the next start measures what is left. The checkpoint goes even where that cannot be
 * entered: the disk may be full. */
static enum status drop_checkpoint(const char *data_dir, struct store *store, int64_t id, struct error *err) {
    const struct disk_use unknown = {.job_id = id, .bytes = -1};
    char *dir = layout_job(data_dir, id);
    if (store_disk_enter(store, &unknown, 1, err) != STATUS_OK)
        log_warning("job %lld: %s", (long long)id, err->message);
    enum status status = attempt_folder_drop_checkpoint(data_dir, id, err);
    if (status == STATUS_OK)
        housekeeping_clean_job(data_dir, store, id, 0);
    status = status == STATUS_OK ? disk_usage_enter_job(store, id, dir, err) : status;
    mem_free(dir);
    return status;
}

/* When in doubt, a job keeps its checkpoint. */
static bool is_old(struct store *store, int64_t id, int64_t before_ms) {
    struct job job;
    if (store_job_get(store, id, &job, NULL) != STATUS_OK)
        return false;
    bool old = job.state == JOB_SUCCEEDED && job.finished_ms < before_ms;
    job_release(&job);
    return old;
}

static void drop_old_checkpoints(const struct scheduler_config *config, struct store *store) {
    int64_t before_ms = (int64_t)(((double)time(NULL) - config->checkpoint_keep_sec) * 1e3);
    char *jobs = layout_jobs(config->data_dir);
    struct error err;
    char **names;
    size_t count;
    if (file_list(jobs, &names, &count, &err) != STATUS_OK && err.status != STATUS_NOT_FOUND)
        log_warning("old checkpoints cannot be found: %s", err.message);
    for (size_t i = 0; i < count; i++) {
        int64_t id = strtoll(names[i], NULL, 10);
        char *holder = NULL;
        if (id <= 0)
            continue;
        enum status status = attempt_folder_with_checkpoint(config->data_dir, id, &holder, &err);
        if (status == STATUS_OK && holder && is_old(store, id, before_ms))
            status = drop_checkpoint(config->data_dir, store, id, &err);
        if (status != STATUS_OK)
            log_warning("job %lld: %s", (long long)id, err.message);
        mem_free(holder);
    }
    file_free_names(names, count);
    mem_free(jobs);
}

static void drop_old_events(const struct scheduler_config *config, struct store *store) {
    int64_t before_ms = (int64_t)(((double)time(NULL) - config->event_keep_sec) * 1e3);
    struct error err;
    bool more = config->event_keep_sec > 0.0;
    while (more)
        if (store_event_prune(store, before_ms, &more, &err) != STATUS_OK) {
            log_warning("old events cannot be removed: %s", err.message);
            return;
        }
}

void housekeeping_run(const struct scheduler_config *config, struct store *store) {
    drop_old_checkpoints(config, store);
    drop_old_events(config, store);
}
