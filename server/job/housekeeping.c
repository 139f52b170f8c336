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
#include "server/data/layout.h"
#include "server/job/measure.h"

enum status housekeeping_drop_checkpoint(const char *dir, struct error *err) {
    /* The journal first: files are found by the database's name, and a journal must never meet another database. */
    char *journal = layout_checkpoint_journal(dir), *checkpoint = layout_checkpoint(dir);
    enum status status = file_remove_tree(journal, err);
    if (status == STATUS_OK)
        status = file_remove_tree(checkpoint, err);
    mem_free(checkpoint);
    mem_free(journal);
    return status;
}

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

void housekeeping_after_kill(const struct scheduler_config *config, struct store *store) {
    struct job jobs[16];
    struct error err;
    size_t count = sizeof jobs / sizeof *jobs;
    for (int64_t before = 0; count == sizeof jobs / sizeof *jobs;) {
        if (store_job_list(store, NULL, JOB_RUNNING, before, sizeof jobs / sizeof *jobs, jobs, &count, &err) !=
            STATUS_OK) {
            log_warning("what killed jobs left cannot be removed: %s", err.message);
            return;
        }
        for (size_t i = 0; i < count; i++) {
            char *dir = layout_job(config->data_dir, jobs[i].id);
            housekeeping_drop_temporary(dir);
            before = jobs[i].id;
            mem_free(dir);
            job_release(&jobs[i]);
        }
    }
}

/* If this is interrupted, the next start measures what is left. The checkpoint goes even where that cannot be
 * entered: the disk may be full. */
static enum status drop_checkpoint(struct store *store, int64_t id, const char *folder, struct error *err) {
    const struct disk_use unknown = {.job_id = id, .bytes = -1};
    if (store_disk_enter(store, &unknown, 1, err) != STATUS_OK)
        log_warning("job %lld: %s", (long long)id, err->message);
    enum status status = housekeeping_drop_checkpoint(folder, err);
    return status == STATUS_OK ? measure_job(store, id, folder, err) : status;
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
        char *folder = file_join(jobs, names[i]), *file = layout_checkpoint(folder);
        if (id > 0 && access(file, F_OK) == 0 && is_old(store, id, before_ms) &&
            drop_checkpoint(store, id, folder, &err) != STATUS_OK)
            log_warning("job %lld: %s", (long long)id, err.message);
        mem_free(file);
        mem_free(folder);
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
