/* store.c -- opens, migrates, closes and counts state.db; see store.h. */
#include "server/store/store.h"

#include <sys/stat.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/data/layout.h"
#include "server/store/internal.h"

#define EVENTS_PER_JOB 20000 /* that are kept, unless the configuration says otherwise */
#define TABLES_MAX 32        /* more than there are */

/* Each step and its version number are one transaction: a crash leaves a complete version. */
static enum status migrate(struct store *store, struct error *err) {
    int64_t version;
    enum status status = sql_int(&store->sql, 0, &version, err, "PRAGMA user_version", "");
    if (status != STATUS_OK)
        return status;
    if (version > schema_version) {
        error_set(err, STATUS_CONFLICT, "%s has schema version %lld, this program knows versions up to %d",
                  store->sql.path, (long long)version, schema_version);
        return error_hint(err, "Run the newer program that last used this data folder.");
    }
    for (; status == STATUS_OK && version < schema_version; version++) {
        char *number = mem_printf("PRAGMA user_version=%lld", (long long)version + 1);
        status = sql_begin(&store->sql, err);
        if (status == STATUS_OK) {
            status = sql_script(&store->sql, schema_steps[version], err);
            if (status == STATUS_OK)
                status = sql_script(&store->sql, number, err);
            status = sql_end(&store->sql, status, err);
        }
        mem_free(number);
    }
    return status;
}

/* The tables that decisions are based on are checked before any decision. Damage in events and outputs, which grow
 * with every job, is found when they are read: a restart must not take longer every day. */
static enum status check_tables(struct store *store, struct error *err) {
    char *names[TABLES_MAX];
    size_t count = 0;
    sqlite3_stmt *stmt;
    enum status status = sql_query(&store->sql, &stmt, err,
                                   "SELECT name FROM sqlite_schema WHERE type = 'table'"
                                   " AND name NOT IN ('events', 'outputs') LIMIT ?",
                                   "n", TABLES_MAX);
    while (sql_next(&store->sql, stmt, &status, err))
        names[count++] = sql_dup(stmt, 0);
    for (size_t i = 0; i < count; i++) {
        if (status == STATUS_OK)
            status = sql_check(&store->sql, names[i], err);
        mem_free(names[i]);
    }
    return status;
}

enum status store_open(struct store **out, const char *dir, struct error *err) {
    *out = NULL;
    struct store *store = mem_calloc(1, sizeof *store);
    pthread_mutexattr_t recursive;
    pthread_mutexattr_init(&recursive);
    pthread_mutexattr_settype(&recursive, PTHREAD_MUTEX_RECURSIVE);
    pthread_mutex_init(&store->mutex, &recursive);
    pthread_mutexattr_destroy(&recursive);
    store->reserve.wal_fd = -1;
    store->events_per_job = EVENTS_PER_JOB;
    char *path = layout_state(dir);
    enum status status = sql_open(&store->sql, path, SQL_WAL, 0, err);
    if (status == STATUS_OK)
        status = check_tables(store, err);
    if (status == STATUS_OK)
        status = migrate(store, err);
    if (status == STATUS_OK)
        status = store_load_has_users(store, err);
    /* Do not overwrite freed pages, as Debian's SQLite does by default: it costs writes. */
    if (status == STATUS_OK)
        status = sql_script(&store->sql, "PRAGMA secure_delete=FAST", err);
    if (status == STATUS_OK)
        status = reserve_open(store, dir, err);
    if (status == STATUS_OK)
        status = file_sync_parent(path, err); /* so that a new file's name is on disk too */
    mem_free(path);
    if (status != STATUS_OK)
        store_close(store);
    else
        *out = store;
    return status;
}

void store_close(struct store *store) {
    if (!store)
        return;
    sql_close(&store->sql);
    reserve_close(store);
    pthread_mutex_destroy(&store->mutex);
    mem_free(store->unpaid);
    mem_free(store->remote.writer);
    mem_free(store);
}

const char *store_library_version(void) { return sqlite3_libversion(); }

void store_on_change(struct store *store, void (*changed)(void *user, int64_t job_id), void *user) {
    store->changed = changed;
    store->changed_user = user;
}

enum status store_probe(struct store *store, struct error *err) {
    int64_t now = store_now_ms(), found = 0;
    enum status status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = sql_run(&store->sql, err, "INSERT OR REPLACE INTO probe (id, at_ms) VALUES (1, ?)", "i", now);
    if (status == STATUS_OK)
        status = sql_int(&store->sql, 0, &found, err, "SELECT at_ms FROM probe WHERE id = 1", "");
    if (status == STATUS_OK && found != now)
        status = error_set(err, STATUS_CORRUPT, "%s: a row read back differs", store->sql.path);
    return store_end(store, status, STORE_NOTHING_CHANGED, err);
}

bool store_has_files(struct store *store, enum store_files kind, const char *id) {
    static const char *const text[] = {
        [STORE_FILES_SCENE] = "SELECT 1 FROM scenes WHERE id = ?",
        [STORE_FILES_JOB] = "SELECT 1 FROM jobs WHERE id = ?",
        [STORE_FILES_UPLOAD] = "SELECT 1 FROM uploads WHERE id = ? AND scene_id = ''",
    };
    int64_t found = 0;
    store_lock(store);
    enum status status = sql_int(&store->sql, 0, &found, NULL, text[kind], "t", id);
    store_unlock(store);
    return status != STATUS_OK || found != 0;
}

static enum status count_by_state(struct store *store, const char *text, int64_t *counts, size_t limit,
                                  struct error *err) {
    sqlite3_stmt *stmt;
    enum status status = sql_query(&store->sql, &stmt, err, text, "");
    while (sql_next(&store->sql, stmt, &status, err)) {
        if ((uint64_t)sqlite3_column_int64(stmt, 0) < limit)
            counts[sqlite3_column_int64(stmt, 0)] = sqlite3_column_int64(stmt, 1);
    }
    return status;
}

enum status store_count(struct store *store, struct store_counts *counts, struct error *err) {
    *counts = (struct store_counts){0};
    store_lock(store);
    enum status status = count_by_state(store, "SELECT state, count(*) FROM jobs GROUP BY state", counts->jobs_by_state,
                                        JOB_STATE_COUNT, err);
    if (status == STATUS_OK)
        status = count_by_state(store, "SELECT state, count(*) FROM scenes GROUP BY state", counts->scenes_by_state,
                                SCENE_STATE_COUNT, err);
    if (status == STATUS_OK)
        status = sql_int(&store->sql, 0, &counts->attempts, err, "SELECT ifnull(sum(attempt), 0) FROM jobs", "");
    if (status == STATUS_OK && counts->jobs_by_state[JOB_QUEUED] > 0)
        status = sql_int(&store->sql, 0, &counts->oldest_queued_ms, err,
                         "SELECT created_ms FROM jobs WHERE id = (SELECT min(id) FROM jobs WHERE state = ?)", "n",
                         (int)JOB_QUEUED);
    if (status == STATUS_OK)
        status = sql_int(&store->sql, 0, &counts->outbox, err, "SELECT count(*) FROM outbox", "");
    /* The highest id, not the number of rows left: a counter only grows. */
    if (status == STATUS_OK)
        status =
            sql_int(&store->sql, 0, &counts->events, err, "SELECT seq FROM sqlite_sequence WHERE name = 'events'", "");
    char *wal = mem_printf("%s-wal", store->sql.path);
    store_unlock(store);
    struct stat info;
    if (status == STATUS_OK && stat(wal, &info) == 0)
        counts->wal_bytes = (uint64_t)info.st_size;
    mem_free(wal);
    return status;
}
