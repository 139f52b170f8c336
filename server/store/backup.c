/* backup.c -- a copy of state.db while the daemon works; see store.h.
 *
 * SQLite's online backup reads through the store's only connection, some pages at a time. Other callers run in between,
 * and their writes go into the copy too (https://sqlite.org/backup.html): it is the database at the time of its last
 * page. */
#include <errno.h>

#include "server/store/internal.h"
#include "server/store/store.h"

#define PAGES_AT_ONCE 1024 /* that are copied without letting other threads in */

/* `number` is the errno of the failed call. */
static enum status failed(sqlite3 *to, int code, int number, const char *path, struct error *err) {
    if (!sql_is_full(code, number))
        return error_set(err, STATUS_IO, "cannot copy the database to %s: %s", path, sqlite3_errmsg(to));
    error_set(err, STATUS_NO_SPACE, "cannot copy the database to %s: the disk is full", path);
    return error_hint(err, "Free some space on the disk that holds the file.");
}

/* Copies page by page; returns SQLITE_DONE, or the error, with errno set. */
static int copy_pages(struct store *store, sqlite3 *to) {
    store_lock(store);
    sqlite3_backup *backup = sqlite3_backup_init(to, "main", store->sql.db, "main");
    store_unlock(store);
    if (!backup)
        return SQLITE_ERROR;
    int code, number;
    do {
        store_lock(store);
        errno = 0;
        code = sqlite3_backup_step(backup, PAGES_AT_ONCE);
        number = errno;
        store_unlock(store);
    } while (code == SQLITE_OK);
    store_lock(store);
    sqlite3_backup_finish(backup);
    store_unlock(store);
    errno = number;
    return code;
}

enum status store_backup(struct store *store, const char *path, struct error *err) {
    sqlite3 *to = NULL;
    enum status status = STATUS_OK;
    errno = 0;
    int code = sqlite3_open_v2(path, &to, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE, NULL);
    if (code == SQLITE_OK)
        code = copy_pages(store, to);
    if (code == SQLITE_DONE) { /* Make it one plain file; otherwise it would need a write-ahead log beside it. */
        errno = 0;
        code = sqlite3_exec(to, "PRAGMA journal_mode=DELETE", NULL, NULL, NULL);
    }
    if (code != SQLITE_OK)
        status = failed(to, code, errno, path, err);
    sqlite3_close(to);
    struct sql copy;
    if (status == STATUS_OK)
        status = sql_open(&copy, path, SQL_ROLLBACK, 0, err);
    if (status == STATUS_OK) {
        status = sql_check(&copy, NULL, err);
        sql_close(&copy);
    }
    return status;
}
