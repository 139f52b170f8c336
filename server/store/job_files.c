/* job_files.c -- see job_files.h. */
#include "server/store/job_files.h"

#include "common/buf.h"
#include "server/store/store.h"
#include "server/store/transition.h"

static enum status check(struct store *store, int64_t id, const char *name, struct present *now, struct error *err) {
    struct buf names;
    int64_t known = 0;
    enum status status =
        sql_int(&store->sql, 0, &known, err, "SELECT 1 FROM job_files WHERE job_id = ? AND name = ?", "it", id, name);
    if (status != STATUS_OK)
        return status;
    buf_init(&names, 1024);
    if (!known) {
        status = store_job_files_names(store, id, false, &names, err);
        if (status == STATUS_OK) {
            error_set(err, STATUS_NOT_FOUND, "the settings of job %lld name no file %.200s", (long long)id, name);
            status = names.length ? error_hint(err, "they name %.300s", buf_text(&names)) : STATUS_NOT_FOUND;
        }
    } else if (now->state != JOB_PAUSED) {
        status = transition_forbidden(now, "given files", err);
    } else {
        status = store_job_files_names(store, id, true, &names, err);
        if (status == STATUS_OK && names.length == 0)
            status = error_set(err, STATUS_CONFLICT, "job %lld has all its files already", (long long)id);
    }
    buf_release(&names);
    return status;
}

enum status store_job_file_check(struct store *store, int64_t id, const char *name, struct error *err) {
    struct present now;
    enum status status = transition_begin(store, id, &now, err);
    if (status != STATUS_OK)
        return status;
    return store_end(store, check(store, id, name, &now, err), STORE_NOTHING_CHANGED, err);
}

/* Enters the file; *is_last: none is missing any more. */
static enum status enter(struct store *store, int64_t id, const char *name, uint64_t bytes, const char *sha256,
                         bool *is_last, struct error *err) {
    struct present now;
    int64_t missing = 1;
    enum status status = transition_begin(store, id, &now, err);
    if (status != STATUS_OK)
        return status;
    status = check(store, id, name, &now, err);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err, "UPDATE job_files SET bytes = ?, sha256 = ? WHERE job_id = ? AND name = ?",
                         "itit", (int64_t)bytes, sha256, id, name);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err, "UPDATE jobs SET revision = revision + 1 WHERE id = ?", "i", id);
    if (status == STATUS_OK)
        status = sql_int(&store->sql, 1, &missing, err, "SELECT count(*) FROM job_files WHERE job_id = ? AND bytes < 0",
                         "i", id);
    *is_last = missing == 0;
    return store_end(store, status, id, err);
}

enum status store_job_file_put(struct store *store, int64_t id, const char *name, uint64_t bytes, const char *sha256,
                               const struct count_limits *limits, bool *queued, struct error *err) {
    *queued = false;
    bool is_last = false;
    enum status status = enter(store, id, name, bytes, sha256, &is_last, err);
    if (status == STATUS_OK && is_last)
        status = store_job_resume(store, id, limits, err);
    *queued = status == STATUS_OK && is_last;
    return status;
}
