/* sql_faults.h -- for one file of a test: the functions of SQLite that sql.c and backup.c call, before the library's
 * own. The n-th call fails without being made, once or from then on; of all or of those of some statements. A rollback
 * does not: SQLite makes it in memory. */
#ifndef UNBAKE_TESTS_SQL_FAULTS_H
#define UNBAKE_TESTS_SQL_FAULTS_H

#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>
#include <sqlite3.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <string.h>

#include "common/error.h"

/* As SQLite fails, and what that is to the store. */
static const struct sql_fault {
    int code, number; /* errno */
    enum status status;
} sql_faults[] = {
    {SQLITE_IOERR_WRITE, EIO, STATUS_IO},          {SQLITE_FULL, 0, STATUS_NO_SPACE},
    {SQLITE_IOERR_FSYNC, ENOSPC, STATUS_NO_SPACE}, {SQLITE_BUSY, 0, STATUS_UNAVAILABLE},
    {SQLITE_CORRUPT, 0, STATUS_CORRUPT},           {SQLITE_CANTOPEN, EACCES, STATUS_IO},
    {SQLITE_CANTOPEN, EDQUOT, STATUS_NO_SPACE},    {SQLITE_IOERR_READ, 0, STATUS_IO},
    {SQLITE_LOCKED, 0, STATUS_UNAVAILABLE},        {SQLITE_NOTADB, 0, STATUS_CORRUPT},
    {SQLITE_MISUSE, 0, STATUS_INTERNAL},
};
#define SQL_FAULTS (sizeof sql_faults / sizeof *sql_faults)

static const struct sql_fault *_Atomic sql_fault; /* the one that is to come */
static atomic_long sql_faults_left;               /* calls until then; 0: none fails */
static const char *_Atomic sql_faults_only;       /* what a statement has in it, or else does not count; NULL: all do */
static atomic_bool sql_faults_stay;               /* all later ones fail, too */
static _Thread_local bool faults_are_off;         /* in this thread, as while SQLite calls itself */

static atomic_bool faults_behind; /* also in the threads that hash and remove behind everybody's back */
static void (*_Atomic faults_watch)(const char *call); /* told of each call before it is made; NULL: nobody */

/* Whether the calls of this thread are no part of what the test does. */
static inline bool faults_pass_by(void) {
    static _Thread_local int is_behind = -1;
    if (is_behind < 0) {
        char name[16] = "";
        pthread_getname_np(pthread_self(), name, sizeof name);
        is_behind = strcmp(name, "digests") == 0 || strcmp(name, "trash") == 0;
    }
    return faults_are_off || (is_behind && !faults_behind);
}

/* The n-th call from now on fails, and if `stays` all that follow; how, goes by n. */
static inline void sql_faults_arm_only(const char *only, long n, bool stays) {
    sql_fault = &sql_faults[(size_t)n % SQL_FAULTS];
    sql_faults_only = only;
    sql_faults_stay = stays;
    atomic_store(&sql_faults_left, n);
}

static inline void sql_faults_arm(long n) { sql_faults_arm_only(NULL, n, false); }

/* Until it is mended all calls fail as a disk does that neither reads nor writes. */
static inline void sql_break(void) {
    sql_faults_arm_only(NULL, SQL_FAULTS, true);
    atomic_store(&sql_faults_left, 1);
}

static inline void sql_mend(void) { atomic_store(&sql_faults_left, 0); }

/* One more call; whether it is the one that fails, or comes after it (`left` stays below 0 then). */
static inline bool faults_strike(atomic_long *left, bool stays) {
    long before = atomic_load(left);
    if (before == 0)
        return false;
    if (before > 0)
        before = atomic_fetch_sub(left, 1);
    if (stays && before == 1)
        atomic_store(left, -1);
    return stays ? before <= 1 : before == 1;
}

/* From now on none does; whether one has. */
static inline bool sql_faults_lift(void) { return atomic_exchange(&sql_faults_left, 0) <= 0; }

static inline bool sql_fails(const char *text) {
    const char *only = sql_faults_only;
    if (faults_watch)
        faults_watch("SQLite");
    if (faults_pass_by() || (only && !(text && strstr(text, only))) ||
        !faults_strike(&sql_faults_left, sql_faults_stay))
        return false;
    errno = sql_fault->number;
    return true;
}

/* The library's own; what it calls meanwhile does not fail. */
#define SQL_PASS(name, type, ...)                                                                                      \
    __typeof__(name) *call;                                                                                            \
    bool outer = faults_are_off;                                                                                       \
    *(void **)&call = dlsym(RTLD_NEXT, #name);                                                                         \
    faults_are_off = true;                                                                                             \
    type result = call(__VA_ARGS__);                                                                                   \
    faults_are_off = outer;                                                                                            \
    return result

/* A rollback, or what the reserve asks after each commit, which does without an answer. */
static inline bool sql_is_spared(const char *text) {
    return text && (strcmp(text, "ROLLBACK") == 0 || strcmp(text, "PRAGMA page_count") == 0);
}

int sqlite3_step(sqlite3_stmt *stmt) {
    if (!sql_is_spared(sqlite3_sql(stmt)) && sql_fails(sqlite3_sql(stmt)))
        return sql_fault->code;
    SQL_PASS(sqlite3_step, int, stmt);
}

int sqlite3_prepare_v3(sqlite3 *db, const char *text, int size, unsigned flags, sqlite3_stmt **stmt,
                       const char **tail) {
    *stmt = NULL;
    if (!sql_is_spared(text) && sql_fails(text))
        return sql_fault->code;
    SQL_PASS(sqlite3_prepare_v3, int, db, text, size, flags, stmt, tail);
}

int sqlite3_prepare_v2(sqlite3 *db, const char *text, int size, sqlite3_stmt **stmt, const char **tail) {
    *stmt = NULL;
    if (sql_fails(text))
        return sql_fault->code;
    SQL_PASS(sqlite3_prepare_v2, int, db, text, size, stmt, tail);
}

int sqlite3_bind_text(sqlite3_stmt *stmt, int index, const char *text, int size, void (*release)(void *)) {
    if (sql_fails(sqlite3_sql(stmt)))
        return sql_fault->code;
    SQL_PASS(sqlite3_bind_text, int, stmt, index, text, size, release);
}

int sqlite3_exec(sqlite3 *db, const char *text, int (*each)(void *, int, char **, char **), void *user, char **why) {
    if (sql_fails(text))
        return sql_fault->code;
    SQL_PASS(sqlite3_exec, int, db, text, each, user, why);
}

int sqlite3_open_v2(const char *path, sqlite3 **db, int flags, const char *vfs) {
    *db = NULL;
    if (sql_fails(NULL))
        return sql_fault->code;
    SQL_PASS(sqlite3_open_v2, int, path, db, flags, vfs);
}

sqlite3_backup *sqlite3_backup_init(sqlite3 *to, const char *to_name, sqlite3 *from, const char *from_name) {
    if (sql_fails(NULL))
        return NULL;
    SQL_PASS(sqlite3_backup_init, sqlite3_backup *, to, to_name, from, from_name);
}

int sqlite3_backup_step(sqlite3_backup *backup, int pages) {
    if (sql_fails(NULL))
        return sql_fault->code;
    SQL_PASS(sqlite3_backup_step, int, backup, pages);
}

#endif
