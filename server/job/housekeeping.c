/* housekeeping.c -- see housekeeping.h. */
#include "server/job/housekeeping.h"

#include <dirent.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"

enum status housekeeping_drop_checkpoint(const char *dir, struct error *err) {
    static const char *const names[] = {"checkpoint.db", "checkpoint.db-journal"};
    enum status status = STATUS_OK;
    for (size_t i = 0; status == STATUS_OK && i < sizeof names / sizeof names[0]; i++) {
        char *path = file_join(dir, names[i]);
        status = file_remove_tree(path, err);
        mem_free(path);
    }
    return status;
}

/* A job in doubt keeps what it has. */
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
    char *jobs = file_join(config->data_dir, "jobs");
    DIR *dir = opendir(jobs);
    struct dirent *entry;
    while (dir && (entry = readdir(dir)) != NULL) {
        struct error err;
        int64_t id = strtoll(entry->d_name, NULL, 10);
        char *folder = file_join(jobs, entry->d_name), *file = file_join(folder, "checkpoint.db");
        if (id > 0 && access(file, F_OK) == 0 && is_old(store, id, before_ms) &&
            housekeeping_drop_checkpoint(folder, &err) != STATUS_OK)
            log_warning("job %lld: %s", (long long)id, err.message);
        mem_free(file);
        mem_free(folder);
    }
    if (dir)
        closedir(dir);
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
