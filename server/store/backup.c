/* backup.c -- a copy of state.db while the daemon works; see store.h.
 *
 * SQLite's online backup, read through the store's one connection, a few pages at a time: other
 * callers get their turns in between, and what they write meanwhile goes into the copy too
 * (https://sqlite.org/backup.html), so that it is the database as of its last page. */
#include "common/file.h"
#include "server/store/internal.h"
#include "server/store/store.h"

#define PAGES_AT_ONCE 1024

/* SQLite's word for it is enough: the copy is a file of its own, and nothing else is touched. */
static enum status failed(sqlite3 *to, const char *path, struct error *err) {
    int code = sqlite3_errcode(to) & 0xff;
    return error_set(err, code == SQLITE_FULL ? STATUS_NO_SPACE : STATUS_IO,
                     "cannot copy the database to %s: %s", path, sqlite3_errmsg(to));
}

static int copy_pages(struct store *store, sqlite3 *to) {
    store_lock(store);
    sqlite3_backup *backup = sqlite3_backup_init(to, "main", store->sql.db, "main");
    store_unlock(store);
    if (!backup)
        return SQLITE_ERROR;
    int code;
    do {
        store_lock(store);
        code = sqlite3_backup_step(backup, PAGES_AT_ONCE);
        store_unlock(store);
    } while (code == SQLITE_OK);
    store_lock(store);
    sqlite3_backup_finish(backup);
    store_unlock(store);
    return code;
}

enum status store_backup(struct store *store, const char *path, struct error *err) {
    sqlite3 *to = NULL;
    enum status status = STATUS_OK;
    int code = sqlite3_open_v2(path, &to, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE, NULL);
    if (code == SQLITE_OK)
        code = copy_pages(store, to);
    /* One plain file: without this it would ask for a write-ahead log beside it. */
    if (code != SQLITE_DONE || sqlite3_exec(to, "PRAGMA journal_mode=DELETE", NULL, NULL, NULL) != SQLITE_OK)
        status = failed(to, path, err);
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
