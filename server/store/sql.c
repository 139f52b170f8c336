/* sql.c -- see sql.h. */
#include "server/store/sql.h"

#include <errno.h>
#include <pthread.h>
#include <stdarg.h>
#include <string.h>

#include "common/mem.h"

/* Out of memory ends the process (mem.h), in SQLite too: otherwise a text that SQLite has no memory for would look
 * empty, and a checkpoint damaged. */
static sqlite3_mem_methods plain_memory;

static void *allocate(int bytes) {
    void *pointer = plain_memory.xMalloc(bytes);
    if (!pointer)
        mem_exhausted("SQLite");
    return pointer;
}

static void *reallocate(void *old, int bytes) {
    void *pointer = plain_memory.xRealloc(old, bytes);
    if (!pointer)
        mem_exhausted("SQLite");
    return pointer;
}

/* Must come before the library's first use; later calls are refused and change nothing. */
static void set_allocator(void) {
    sqlite3_mem_methods ours;
    if (sqlite3_config(SQLITE_CONFIG_GETMALLOC, &plain_memory) != SQLITE_OK)
        return;
    ours = plain_memory;
    ours.xMalloc = allocate;
    ours.xRealloc = reallocate;
    sqlite3_config(SQLITE_CONFIG_MALLOC, &ours);
}

bool sql_is_full(int code, int number) {
    bool is_full = number == ENOSPC || number == EDQUOT || number == EFBIG;
    code &= 0xff;
    return code == SQLITE_FULL || (is_full && (code == SQLITE_IOERR || code == SQLITE_CANTOPEN));
}

/* Maps an SQLite result to ours. Callers set errno to 0 before the call: sqlite3_system_errno is not set when
 * sqlite3_step fails, while SQLite's VFS leaves the errno. */
static enum status fail(struct sql *sql, int code, const char *doing, struct error *err) {
    int os = errno;
    const char *why = sql->db ? sqlite3_errmsg(sql->db) : sqlite3_errstr(code);
    if (sql_is_full(code, os)) {
        error_set(err, STATUS_NO_SPACE, "%s: %s", sql->path, strerror(os == EDQUOT || os == EFBIG ? os : ENOSPC));
        return error_hint(err, "Free some space on the disk that holds the file.");
    }
    switch (code & 0xff) {
    case SQLITE_IOERR:
        return error_set(err, STATUS_IO, "%s: cannot %s: %s (%s)", sql->path, doing, why,
                         os ? strerror(os) : "no errno");
    case SQLITE_BUSY:
    case SQLITE_LOCKED: return error_set(err, STATUS_UNAVAILABLE, "%s is in use by another process", sql->path);
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB: return error_set(err, STATUS_CORRUPT, "%s is damaged: %s", sql->path, why);
    case SQLITE_CANTOPEN:
    case SQLITE_READONLY:
    case SQLITE_PERM: return error_set(err, STATUS_IO, "%s: cannot %s: %s", sql->path, doing, why);
    default: return error_set(err, STATUS_INTERNAL, "%s: cannot %s: %s", sql->path, doing, why);
    }
}

enum status sql_script(struct sql *sql, const char *text, struct error *err) {
    errno = 0;
    int code = sqlite3_exec(sql->db, text, NULL, NULL, NULL);
    return code == SQLITE_OK ? STATUS_OK : fail(sql, code, text, err);
}

static enum status prepare(struct sql *sql, const char *text, sqlite3_stmt **stmt, struct error *err) {
    for (size_t i = 0; i < sql->statement_count; i++) {
        if (sql->statement[i].text == text) {
            *stmt = sql->statement[i].stmt;
            sqlite3_reset(*stmt);
            return STATUS_OK;
        }
    }
    if (sql->statement_count == SQL_STATEMENT_MAX)
        return error_set(err, STATUS_INTERNAL, "more than %d SQL statements", SQL_STATEMENT_MAX);
    errno = 0;
    int code = sqlite3_prepare_v3(sql->db, text, -1, SQLITE_PREPARE_PERSISTENT, stmt, NULL);
    if (code != SQLITE_OK)
        return fail(sql, code, text, err);
    sql->statement[sql->statement_count].text = text;
    sql->statement[sql->statement_count].stmt = *stmt;
    sql->statement_count++;
    return STATUS_OK;
}

/* Texts and blobs are bound without a copy: in every caller they outlive the statement's run, and a query's values
 * outlive its loop. */
static int bind_all(sqlite3_stmt *stmt, const char *types, va_list args) {
    int code = SQLITE_OK;
    for (int i = 1; types[i - 1] && code == SQLITE_OK; i++) {
        switch (types[i - 1]) {
        case 'i': code = sqlite3_bind_int64(stmt, i, va_arg(args, int64_t)); break;
        case 'n': code = sqlite3_bind_int(stmt, i, va_arg(args, int)); break;
        case 'd': code = sqlite3_bind_double(stmt, i, va_arg(args, double)); break;
        case 't': code = sqlite3_bind_text(stmt, i, va_arg(args, const char *), -1, SQLITE_STATIC); break;
        case 'b': {
            const void *data = va_arg(args, const void *);
            code = sqlite3_bind_blob64(stmt, i, data, va_arg(args, size_t), SQLITE_STATIC);
            break;
        }
        default: code = SQLITE_MISUSE;
        }
    }
    return code;
}

static enum status query(struct sql *sql, sqlite3_stmt **stmt, const char *text, const char *types, va_list args,
                         struct error *err) {
    enum status status = prepare(sql, text, stmt, err);
    if (status != STATUS_OK)
        return status;
    int code = bind_all(*stmt, types, args);
    return code == SQLITE_OK ? STATUS_OK : fail(sql, code, text, err);
}

enum status sql_query(struct sql *sql, sqlite3_stmt **stmt, struct error *err, const char *text, const char *types,
                      ...) {
    va_list args;
    va_start(args, types);
    enum status status = query(sql, stmt, text, types, args, err);
    va_end(args);
    return status;
}

enum status sql_step(struct sql *sql, sqlite3_stmt *stmt, bool *row, struct error *err) {
    errno = 0;
    int code = sqlite3_step(stmt);
    *row = code == SQLITE_ROW;
    if (code == SQLITE_ROW)
        return STATUS_OK;
    enum status status = STATUS_OK;
    if (code != SQLITE_DONE)
        status = fail(sql, code, sqlite3_sql(stmt), err);
    sqlite3_reset(stmt);
    return status;
}

bool sql_next(struct sql *sql, sqlite3_stmt *stmt, enum status *status, struct error *err) {
    bool row = false;
    if (*status == STATUS_OK)
        *status = sql_step(sql, stmt, &row, err);
    return row;
}

enum status sql_run(struct sql *sql, struct error *err, const char *text, const char *types, ...) {
    sqlite3_stmt *stmt;
    va_list args;
    va_start(args, types);
    enum status status = query(sql, &stmt, text, types, args, err);
    va_end(args);
    while (sql_next(sql, stmt, &status, err)) {
    }
    return status;
}

enum status sql_first(struct sql *sql, sqlite3_stmt **stmt, bool *row, struct error *err, const char *text,
                      const char *types, ...) {
    va_list args;
    va_start(args, types);
    enum status status = query(sql, stmt, text, types, args, err);
    va_end(args);
    *row = false;
    return status == STATUS_OK ? sql_step(sql, *stmt, row, err) : status;
}

enum status sql_int(struct sql *sql, int64_t fallback, int64_t *value, struct error *err, const char *text,
                    const char *types, ...) {
    sqlite3_stmt *stmt;
    va_list args;
    va_start(args, types);
    enum status status = query(sql, &stmt, text, types, args, err);
    va_end(args);
    *value = fallback;
    bool row;
    if (status == STATUS_OK)
        status = sql_step(sql, stmt, &row, err);
    if (status == STATUS_OK && row) {
        *value = sqlite3_column_int64(stmt, 0);
        sqlite3_reset(stmt);
    }
    return status;
}

int64_t sql_changes(const struct sql *sql) { return sqlite3_changes64(sql->db); }

const char *sql_text(sqlite3_stmt *stmt, int column) {
    const unsigned char *text = sqlite3_column_text(stmt, column);
    return text ? (const char *)text : "";
}

char *sql_dup(sqlite3_stmt *stmt, int column) { return mem_strdup(sql_text(stmt, column)); }

enum status sql_begin(struct sql *sql, struct error *err) { return sql_run(sql, err, "BEGIN IMMEDIATE", ""); }

enum status sql_end(struct sql *sql, enum status status, struct error *err) {
    if (status == STATUS_OK)
        status = sql_run(sql, err, "COMMIT", "");
    /* After some errors (a full disk) SQLite has rolled back by itself. A rollback that fails is left to the journal,
     * at the next open. */
    if (status != STATUS_OK && !sqlite3_get_autocommit(sql->db))
        sql_run(sql, NULL, "ROLLBACK", "");
    return status;
}

/* SQLite answers a pragma that it does not know or cannot obey with another value, not with an error. */
static enum status expect(struct sql *sql, const char *pragma, const char *wanted, struct error *err) {
    sqlite3_stmt *stmt = NULL;
    errno = 0;
    int code = sqlite3_prepare_v2(sql->db, pragma, -1, &stmt, NULL);
    if (code == SQLITE_OK)
        code = sqlite3_step(stmt);
    enum status status = STATUS_OK;
    if (code != SQLITE_ROW)
        status = fail(sql, code, pragma, err);
    else if (strcmp(sql_text(stmt, 0), wanted) != 0)
        status = error_set(err, STATUS_INTERNAL, "%s: %s says \"%s\", expected \"%s\"", sql->path, pragma,
                           sql_text(stmt, 0), wanted);
    sqlite3_finalize(stmt);
    return status;
}

static enum status configure(struct sql *sql, enum sql_journal journal, int page_size, struct error *err) {
    char *size = mem_printf("PRAGMA page_size=%d", page_size);
    enum status status = page_size ? sql_script(sql, size, err) : STATUS_OK;
    mem_free(size);
    /* Lock mode before journal mode: WAL then needs no shared memory, and the first access keeps the lock. */
    if (status == STATUS_OK)
        status = expect(sql, "PRAGMA locking_mode=EXCLUSIVE", "exclusive", err);
    if (status == STATUS_OK)
        status = journal == SQL_WAL ? expect(sql, "PRAGMA journal_mode=WAL", "wal", err)
                                    : expect(sql, "PRAGMA journal_mode=TRUNCATE", "truncate", err);
    if (status == STATUS_OK)
        status = sql_script(sql,
                            "PRAGMA synchronous=FULL; PRAGMA foreign_keys=ON;"
                            "PRAGMA trusted_schema=OFF; PRAGMA cell_size_check=ON;"
                            "PRAGMA journal_size_limit=67108864; PRAGMA temp_store=MEMORY;"
                            "PRAGMA mmap_size=0; BEGIN EXCLUSIVE; COMMIT",
                            err);
    if (status == STATUS_OK)
        status = expect(sql, "PRAGMA synchronous", "2", err);
    if (status == STATUS_OK)
        status = expect(sql, "PRAGMA foreign_keys", "1", err);
    return status;
}

enum status sql_check(struct sql *sql, const char *table, struct error *err) {
    char *pragma = table ? mem_printf("PRAGMA quick_check('%s')", table) : mem_strdup("PRAGMA quick_check(1)");
    enum status status = expect(sql, pragma, "ok", err);
    mem_free(pragma);
    if (status == STATUS_INTERNAL && err)
        status = err->status = STATUS_CORRUPT;
    return status;
}

enum status sql_open(struct sql *sql, const char *path, enum sql_journal journal, int page_size, struct error *err) {
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    pthread_once(&once, set_allocator);
    *sql = (struct sql){.path = mem_strdup(path)};
    errno = 0;
    int code = sqlite3_open_v2(
        path, &sql->db, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_EXRESCODE, NULL);
    enum status status = code == SQLITE_OK ? configure(sql, journal, page_size, err) : fail(sql, code, "open", err);
    if (status != STATUS_OK)
        sql_close(sql);
    return status;
}

void sql_close(struct sql *sql) {
    for (size_t i = 0; i < sql->statement_count; i++)
        sqlite3_finalize(sql->statement[i].stmt);
    sqlite3_close(sql->db);
    mem_free(sql->path);
    *sql = (struct sql){0};
}
