/* job_inputs.c -- whether a job has what it reads: files that its settings name (job_files.h) and the outputs of
 * another job, which stay as they are while it reads them. */
#include "common/buf.h"
#include "common/output_names.h"
#include "server/store/job_files.h"
#include "server/store/store.h"
#include "server/store/transition.h"

enum status store_job_files_names(struct store *store, int64_t job_id, bool only_missing, struct buf *names,
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
    enum status status = store_job_files_names(store, id, true, &names, err);
    if (status == STATUS_OK && names.length > 0) {
        error_set(err, STATUS_CONFLICT, "job %lld waits for its files: %.300s", (long long)id, buf_text(&names));
        status = error_hint(err, JOB_FILES_HINT);
    }
    buf_release(&names);
    return status;
}

enum status source_check_readable(struct store *store, int64_t id, struct error *err) {
    struct present now = {0};
    int64_t kind = 0, files = 0;
    enum status status = transition_read(store, id, &now, err);
    if (status == STATUS_OK)
        status = sql_int(&store->sql, 0, &kind, err, "SELECT kind FROM jobs WHERE id = ?", "i", id);
    if (status == STATUS_OK && kind != (int)JOB_RECONSTRUCT)
        return error_set(err, STATUS_CONFLICT, "job %lld is no reconstruction: its kind is %s", (long long)id,
                         job_kind_name((enum job_kind)kind));
    if (status == STATUS_OK && now.state != JOB_SUCCEEDED) {
        error_set(err, STATUS_CONFLICT, "job %lld has no results to read: it is %s", (long long)id,
                  job_state_name(now.state));
        return error_hint(err, job_is_terminal(now.state) ? "Retry it first."
                               : now.state == JOB_PAUSED  ? "Resume it first."
                                                          : "Wait for its end.");
    }
    if (status == STATUS_OK)
        status = sql_int(&store->sql, 0, &files, err, "SELECT count(*) FROM outputs WHERE job_id = ? AND name = ?",
                         "it", id, OUTPUT_MESH);
    if (status == STATUS_OK && files == 0)
        status = error_set(err, STATUS_CONFLICT, "job %lld has no output " OUTPUT_MESH, (long long)id);
    return status;
}

enum status store_source_check_readable(struct store *store, int64_t id, struct error *err) {
    store_lock(store);
    enum status status = source_check_readable(store, id, err);
    store_unlock(store);
    return status;
}

enum status store_source_check_unread(struct store *store, int64_t id, const char *action, struct error *err) {
    store_lock(store);
    enum status status = source_check_unread(store, id, action, err);
    store_unlock(store);
    return status;
}

enum status source_check_unread(struct store *store, int64_t id, const char *action, struct error *err) {
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
