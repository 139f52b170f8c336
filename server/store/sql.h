/* sql.h -- a thin layer over SQLite: open safely, run, step, map errors to ours.
 *
 * 1. One `struct sql` is the only connection to its file: opening takes an exclusive lock that is
 *    kept until the file is closed, and a second connection, of any process, is refused.
 * 2. Commits are durable when they return (synchronous=FULL).
 * 3. A statement is prepared once and kept; its text is a string literal (the cache compares
 *    pointers). sql_run and sql_query reset it first, so two loops must not share a statement.
 *
 * Not thread-safe: the owner serialises. Shared by the store and the worker's checkpoint. */
#ifndef UNBAKE_STORE_SQL_H
#define UNBAKE_STORE_SQL_H

#include <sqlite3.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"

#define SQL_STATEMENT_MAX 192 /* prepared statements that are kept */

struct sql {
    sqlite3 *db;
    char *path; /* owned */
    size_t statement_count;
    struct {
        const char *text;
        sqlite3_stmt *stmt;
    } statement[SQL_STATEMENT_MAX];
};

enum sql_journal {
    SQL_WAL,     /* many small commits */
    SQL_ROLLBACK /* few large commits: appended data is written once, not twice */
};

/* page_size: for a new file; 0: SQLite's default. STATUS_UNAVAILABLE when another process has the file open,
 * STATUS_CORRUPT when its header is damaged (sql_check reads all of it). */
enum status sql_open(struct sql *sql, const char *path, enum sql_journal journal, int page_size, struct error *err);
void sql_close(struct sql *sql);

/* SQLite's quick_check of the whole file, or of one table with its indices; reads all of it. STATUS_CORRUPT names the
 * first fault. */
enum status sql_check(struct sql *sql, const char *table, struct error *err);

/* Runs several statements without parameters. */
enum status sql_script(struct sql *sql, const char *text, struct error *err);

/* Binds values and runs the statement to its end. `types` has one letter a value: i int64_t, n int, d double, t const
 * char * (NULL: null), b const void * and size_t (a blob, borrowed until the return). */
enum status sql_run(struct sql *sql, struct error *err, const char *text, const char *types, ...);
/* As sql_run, but stops before the first row: continue with sql_next or sql_step. */
enum status sql_query(struct sql *sql, sqlite3_stmt **stmt, struct error *err, const char *text, const char *types,
                      ...);
/* *row: there is another row; after the last one the statement is reset. */
enum status sql_step(struct sql *sql, sqlite3_stmt *stmt, bool *row, struct error *err);
/* For loops over all rows: whether there is another one. False as well where *status is not STATUS_OK, before or after
 * the step. Who leaves the loop early calls sqlite3_reset. */
bool sql_next(struct sql *sql, sqlite3_stmt *stmt, enum status *status, struct error *err);
/* As sql_query, and steps to the first row; *row: there is one. The caller then calls sqlite3_reset. */
enum status sql_first(struct sql *sql, sqlite3_stmt **stmt, bool *row, struct error *err, const char *text,
                      const char *types, ...);
/* The first column of the first row as an integer; `fallback` when there is no row. */
enum status sql_int(struct sql *sql, int64_t fallback, int64_t *value, struct error *err, const char *text,
                    const char *types, ...);

/* Whether SQLite's result and the errno at that moment mean a full disk: reported as IOERR by a failed write, sync or
 * ftruncate, and as CANTOPEN where a file cannot be created. */
bool sql_is_full(int code, int number);

/* Rows changed by the last statement. */
int64_t sql_changes(const struct sql *sql);
/* A text column, never NULL; sql_text: borrowed until the next step; sql_dup: a copy, the caller's. */
const char *sql_text(sqlite3_stmt *stmt, int column);
char *sql_dup(sqlite3_stmt *stmt, int column);

/* BEGIN IMMEDIATE; then COMMIT where `status` is STATUS_OK, else ROLLBACK. sql_end returns `status`, or why the
 * commit failed (nothing has changed then). */
enum status sql_begin(struct sql *sql, struct error *err);
enum status sql_end(struct sql *sql, enum status status, struct error *err);

#endif
