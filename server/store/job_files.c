/* job_files.c -- see job_files.h; and what one job may do while another reads its outputs. */
#include "server/store/job_files.h"

#include "common/buf.h"
#include "server/store/store.h"
#include "server/store/transition.h"

/* Inside a transaction: the names of the job's files (that are missing). */
static enum status name_them(struct store *store, int64_t job_id, bool only_missing, struct buf *names,
                             struct error *err) {
    sqlite3_stmt *stmt;
    enum status status = sql_query(&store->sql, &stmt, err,
                                   "SELECT name FROM job_files WHERE job_id = ? AND (bytes < 0 OR NOT ?)"
                                   " ORDER BY name",
                                   "in", job_id, (int)only_missing);
    while (sql_next(&store->sql, stmt, &status, err))
        buf_printf(names, "%s%s", names->length ? ", " : "", sql_text(stmt, 0));
    return status;
}

enum status store_job_files_check(struct store *store, int64_t id, struct error *err) {
    struct buf names;
    buf_init(&names, 1024);
    enum status status = name_them(store, id, true, &names, err);
    if (status == STATUS_OK && names.length > 0) {
        error_set(err, STATUS_CONFLICT, "job %lld waits for its files: %.300s", (long long)id, buf_text(&names));
        status = error_hint(err, JOB_FILES_HINT);
    }
    buf_release(&names);
    return status;
}

static enum status check(struct store *store, int64_t id, const char *name, struct present *now, struct error *err) {
    struct buf names;
    int64_t known = 0;
    enum status status =
        sql_int(&store->sql, 0, &known, err, "SELECT 1 FROM job_files WHERE job_id = ? AND name = ?", "it", id, name);
    if (status != STATUS_OK)
        return status;
    buf_init(&names, 1024);
    if (!known) {
        status = name_them(store, id, false, &names, err);
        if (status == STATUS_OK) {
            error_set(err, STATUS_NOT_FOUND, "the settings of job %lld name no file %.200s", (long long)id, name);
            status = names.length ? error_hint(err, "they name %.300s", buf_text(&names)) : STATUS_NOT_FOUND;
        }
    } else if (now->state != JOB_PAUSED) {
        status = transition_forbidden(now, "given files", err);
    } else {
        status = name_them(store, id, true, &names, err);
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

/* --- what a job reads ------------------------------------------------------------------------ */

enum status store_source_ready(struct store *store, int64_t id, struct error *err) {
    struct present now = {0};
    int64_t kind = 0, files = 0;
    enum status status = transition_look(store, id, &now, err);
    if (status == STATUS_OK)
        status = sql_int(&store->sql, 0, &kind, err, "SELECT kind FROM jobs WHERE id = ?", "i", id);
    if (status == STATUS_OK && kind != (int)JOB_RECONSTRUCT)
        return error_set(err, STATUS_CONFLICT, "job %lld is no reconstruction: its kind is %s", (long long)id,
                         job_kind_name((enum job_kind)kind));
    if (status == STATUS_OK && now.state != JOB_SUCCEEDED) {
        error_set(err, STATUS_CONFLICT, "job %lld has no results to read: it is %s", (long long)id,
                  job_state_name(now.state));
        return error_hint(err, job_is_terminal(now.state) ? "Retry it first." : "Wait for its end.");
    }
    if (status == STATUS_OK)
        status = sql_int(&store->sql, 0, &files, err, "SELECT count(*) FROM outputs WHERE job_id = ? AND name = ?",
                         "it", id, JOB_SOURCE_OUTPUT);
    if (status == STATUS_OK && files == 0)
        status = error_set(err, STATUS_CONFLICT, "job %lld has no output " JOB_SOURCE_OUTPUT, (long long)id);
    return status;
}

enum status store_source_look(struct store *store, int64_t id, struct error *err) {
    store_lock(store);
    enum status status = store_source_ready(store, id, err);
    store_unlock(store);
    return status;
}

enum status store_source_free(struct store *store, int64_t id, const char *action, struct error *err) {
    store_lock(store);
    enum status status = store_source_check(store, id, action, err);
    store_unlock(store);
    return status;
}

enum status store_source_check(struct store *store, int64_t id, const char *action, struct error *err) {
    int64_t reader = 0;
    enum status status =
        sql_int(&store->sql, 0, &reader, err,
                "SELECT id FROM jobs WHERE source_id = ? AND source_id > 0 AND state <= 2 LIMIT 1", "i", id);
    if (status != STATUS_OK || reader == 0)
        return status;
    error_set(err, STATUS_CONFLICT, "job %lld reads the outputs of job %lld, which cannot be %s before it has ended",
              (long long)reader, (long long)id, action);
    return error_hint(err, "Cancel job %lld or wait for its end.", (long long)reader);
}
