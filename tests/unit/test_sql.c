/* test_sql.c -- the layer over SQLite where it is misused or its settings cannot be made, and the store where what it
 * reads is not what it wrote, or the disk is full. */
#include "server/store/internal.h"
#include "tests/sql_faults.h"
#include "tests/unit/store_rig.h"

/* --- statements ------------------------------------------------------------------------------------- */

/* One statement too many is refused, and those that there are go on working. */
static void test_many(const char *dir) {
    static char texts[SQL_STATEMENT_MAX + 1][24];
    struct sql sql;
    int64_t value;
    char *path = file_join(dir, "many.db");
    OK(sql_open(&sql, path, SQL_ROLLBACK, 4096, &err));
    for (int i = 0; i <= SQL_STATEMENT_MAX; i++) {
        snprintf(texts[i], sizeof texts[i], "SELECT %d", i);
        enum status status = sql_int(&sql, -1, &value, &err, texts[i], "");
        CHECK_THAT(status == (i < SQL_STATEMENT_MAX ? STATUS_OK : STATUS_INTERNAL), "%d: %s", i, err.message);
        CHECK(value == (status == STATUS_OK ? i : -1));
    }
    CHECK_THAT(strstr(err.message, "SQL statements"), "%s", err.message);
    OK(sql_int(&sql, -1, &value, &err, texts[7], ""));
    CHECK(value == 7);
    sql_close(&sql);
    mem_free(path);
}

/* Each call that opens a database fails once: it is closed again, and can be opened. */
static void test_opening(const char *dir) {
    struct sql sql;
    char *path = file_join(dir, "opened.db");
    bool struck = true;
    for (long n = 1; struck && check_failed_count == 0; n++) {
        sql_faults_arm(n);
        enum status status = sql_open(&sql, path, SQL_ROLLBACK, 4096, &err);
        struck = sql_faults_lift();
        CHECK_THAT(status == (struck ? sql_fault->status : STATUS_OK), "call %ld: %s", n, status_name(status));
        CHECK(!struck || (sql.db == NULL && err.status == status && *err.message));
        if (status == STATUS_OK)
            sql_close(&sql);
    }
    mem_free(path);
}

/* --- what is read back ------------------------------------------------------------------------------ */

static void test_probe(struct store *store) {
    OK(store_probe(store, &err));
    OK(sql_script(&store->sql, "CREATE TRIGGER lie AFTER INSERT ON probe BEGIN UPDATE probe SET at_ms = at_ms + 1; END",
                  &err));
    IS(store_probe(store, &err), STATUS_CORRUPT);
    CHECK_THAT(strstr(err.message, "a row read back differs"), "%s", err.message);
    CHECK(sqlite3_get_autocommit(store->sql.db));
    OK(sql_script(&store->sql, "DROP TRIGGER lie", &err));
    OK(store_probe(store, &err));
}

/* Somebody has removed the log: it has no size, and figures are told all the same. */
static void test_log(struct store *store) {
    struct store_counts counts;
    char *path = mem_printf("%s-wal", store->sql.path);
    OK(store_count(store, &counts, &err));
    CHECK(counts.wal_bytes > 0);
    CHECK(unlink(path) == 0);
    OK(store_count(store, &counts, &err));
    CHECK(counts.wal_bytes == 0 && counts.scenes_by_state[SCENE_READY] == 1);
    mem_free(path);
}

/* --- a full disk ------------------------------------------------------------------------------------ */

static ssize_t no_room(int fd, const void *data, size_t length, off_t at) {
    (void)fd, (void)data, (void)length, (void)at;
    errno = ENOSPC;
    return -1;
}

static int set_write(sqlite3_syscall_ptr call) {
    sqlite3_vfs *vfs = sqlite3_vfs_find(NULL);
    bool is_wide = vfs->xGetSystemCall(vfs, "pwrite64") != NULL;
    return vfs->xSetSystemCall(vfs, is_wide ? "pwrite64" : "pwrite", call);
}

/* The copy does not fit; the database itself is as it was. */
static void test_backup(struct store *store, const char *dir) {
    char *path = file_join(dir, "copy.db");
    CHECK(set_write((sqlite3_syscall_ptr)no_room) == SQLITE_OK);
    IS(store_backup(store, path, &err), STATUS_NO_SPACE);
    CHECK(set_write(NULL) == SQLITE_OK);
    CHECK_THAT(strstr(err.message, "cannot copy the database to") && strstr(err.message, path), "%s", err.message);
    OK(store_probe(store, &err));
    unlink(path);
    OK(store_backup(store, path, &err));
    mem_free(path);
}

int main(void) {
    struct store *store;
    char *dir = fresh_dir();
    test_many(dir);
    test_opening(dir);
    OK(store_open(&store, dir, &err));
    add_ready_scene(store, SCENE_A);
    test_probe(store);
    test_backup(store, dir);
    test_log(store);
    store_close(store);
    drop_dir(dir);
    return check_result();
}
