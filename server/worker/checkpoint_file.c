/* checkpoint_file.c -- see checkpoint_file.h. */
#include "server/worker/checkpoint_file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "common/file.h"
#include "common/hash64.h"
#include "common/mem.h"
#include "server/state/state_array.h"

/* SQLite's largest page: a tile is a chain of 16 pages, not of 256. */
#define PAGE_SIZE 65536

size_t checkpoint_file_tile_count(size_t bytes) { return (bytes + CHECKPOINT_TILE_BYTES - 1) / CHECKPOINT_TILE_BYTES; }

size_t checkpoint_file_tile_bytes(size_t array_bytes, size_t tile) {
    size_t left = array_bytes - tile * CHECKPOINT_TILE_BYTES;
    return left < CHECKPOINT_TILE_BYTES ? left : CHECKPOINT_TILE_BYTES;
}

void checkpoint_file_release(struct stored_array *array, size_t count) {
    for (size_t i = 0; i < count; i++) {
        mem_free(array[i].name);
        mem_free(array[i].tile);
    }
    mem_free(array);
}

uint64_t checkpoint_file_digest(const struct stored_array *array, size_t count, long iteration,
                                const char *fingerprint) {
    uint64_t digest = hash64(fingerprint, strlen(fingerprint), (uint64_t)iteration);
    for (size_t i = 0; i < count; i++) {
        digest = hash64(array[i].name, strlen(array[i].name) + 1, digest);
        for (size_t t = 0; t < array[i].tile_count; t++)
            digest = hash64(&array[i].tile[t].hash, sizeof(uint64_t), digest);
        digest = hash64(&array[i].bytes, sizeof array[i].bytes, digest);
    }
    return digest;
}

enum status checkpoint_file_write_format(struct checkpoint_file *f, struct error *err) {
    char text[48];
    snprintf(text, sizeof text, "PRAGMA user_version=%d", STATE_FORMAT);
    return sql_script(&f->sql, text, err);
}

static enum status create_tables(struct checkpoint_file *f, struct error *err) {
    enum status status = sql_begin(&f->sql, err);
    if (status != STATUS_OK)
        return status;
    status = sql_script(&f->sql,
                        "CREATE TABLE newest (id INTEGER PRIMARY KEY CHECK (id = 1),"
                        " fingerprint TEXT NOT NULL, program TEXT NOT NULL,"
                        " iteration INTEGER NOT NULL, digest INTEGER NOT NULL) STRICT;"
                        "CREATE TABLE arrays (number INTEGER PRIMARY KEY, name TEXT NOT NULL,"
                        " bytes INTEGER NOT NULL) STRICT;"
                        "CREATE TABLE tiles (id INTEGER PRIMARY KEY, array INTEGER NOT NULL,"
                        " number INTEGER NOT NULL, hash INTEGER NOT NULL, data BLOB NOT NULL)"
                        " STRICT;",
                        err);
    if (status == STATUS_OK)
        status = checkpoint_file_write_format(f, err);
    return sql_end(&f->sql, status, err);
}

enum status checkpoint_file_damaged(struct checkpoint_file *f, const char *what, struct error *err) {
    return error_set(err, STATUS_CORRUPT, "%s: %s", f->sql.path, what);
}

static enum status read_arrays(struct checkpoint_file *f, struct error *err) {
    sqlite3_stmt *stmt;
    enum status status = sql_query(&f->sql, &stmt, err, "SELECT number, name, bytes FROM arrays ORDER BY number", "");
    while (sql_next(&f->sql, stmt, &status, err)) {
        int64_t bytes = sqlite3_column_int64(stmt, 2);
        if (sqlite3_column_int64(stmt, 0) != (int64_t)f->array_count || bytes < 0 ||
            (uint64_t)bytes > (uint64_t)1 << 44) {
            sqlite3_reset(stmt);
            return checkpoint_file_damaged(f, "its list of arrays makes no sense", err);
        }
        f->array = mem_realloc_array(f->array, f->array_count + 1, sizeof *f->array);
        size_t tiles = checkpoint_file_tile_count((size_t)bytes);
        f->array[f->array_count++] = (struct stored_array){
            .name = sql_dup(stmt, 1),
            .bytes = (size_t)bytes,
            .tile_count = tiles,
            .tile = mem_calloc(tiles ? tiles : 1, sizeof(struct checkpoint_tile)),
        };
    }
    return status;
}

/* Reads every tile and checks its position, size and hash. */
static enum status read_tiles(struct checkpoint_file *f, struct error *err) {
    sqlite3_stmt *stmt;
    enum status status = sql_query(&f->sql, &stmt, err, "SELECT id, array, number, hash, data FROM tiles", "");
    while (sql_next(&f->sql, stmt, &status, err)) {
        uint64_t a = (uint64_t)sqlite3_column_int64(stmt, 1);
        uint64_t t = (uint64_t)sqlite3_column_int64(stmt, 2);
        struct checkpoint_tile found = {.row = sqlite3_column_int64(stmt, 0),
                                        .hash = (uint64_t)sqlite3_column_int64(stmt, 3)};
        bool fits = a < f->array_count && t < f->array[a].tile_count && f->array[a].tile[t].row == 0;
        if (fits) {
            size_t bytes = checkpoint_file_tile_bytes(f->array[a].bytes, t);
            const void *data = sqlite3_column_blob(stmt, 4);
            fits = data && (size_t)sqlite3_column_bytes(stmt, 4) == bytes && hash64(data, bytes, 0) == found.hash;
        }
        if (!fits) {
            sqlite3_reset(stmt);
            return checkpoint_file_damaged(f, "a tile fails its check", err);
        }
        f->array[a].tile[t] = found;
        if (found.row >= f->next_row)
            f->next_row = found.row + 1;
    }
    for (size_t a = 0; status == STATUS_OK && a < f->array_count; a++)
        for (size_t t = 0; t < f->array[a].tile_count; t++)
            if (f->array[a].tile[t].row == 0)
                return checkpoint_file_damaged(f, "a tile is missing", err);
    return status;
}

/* Reads and verifies the commit. note[0] is set when it cannot be used. */
static enum status read_commit(struct checkpoint_file *f, char note[512], struct error *err) {
    int64_t version, table_count;
    enum status status = sql_int(&f->sql, 0, &version, err, "PRAGMA user_version", "");
    if (status == STATUS_OK)
        status = sql_int(&f->sql, 0, &table_count, err, "SELECT count(*) FROM sqlite_schema", "");
    if (status == STATUS_OK && version == 0 && table_count == 0)
        return create_tables(f, err);
    if (status == STATUS_OK && (version < 1 || version > STATE_FORMAT))
        snprintf(note, 512, "the checkpoint has format %lld, this program reads up to %d", (long long)version,
                 STATE_FORMAT);
    if (status != STATUS_OK || note[0])
        return status;
    sqlite3_stmt *stmt;
    bool row;
    uint64_t digest = 0;
    status = sql_query(&f->sql, &stmt, err, "SELECT fingerprint, iteration, digest, program FROM newest", "");
    if (status == STATUS_OK)
        status = sql_step(&f->sql, stmt, &row, err);
    if (status != STATUS_OK || !row)
        return status;
    bool same = strcmp(sql_text(stmt, 0), f->fingerprint) == 0;
    f->iteration = (long)sqlite3_column_int64(stmt, 1);
    digest = (uint64_t)sqlite3_column_int64(stmt, 2);
    f->format = (int)version;
    f->program = sql_dup(stmt, 3);
    sqlite3_reset(stmt);
    if (!same) {
        snprintf(note, 512, "the checkpoint belongs to another scene, another reading of it or other settings");
        return STATUS_OK;
    }
    status = read_arrays(f, err);
    if (status == STATUS_OK)
        status = read_tiles(f, err);
    if (status == STATUS_OK && checkpoint_file_digest(f->array, f->array_count, f->iteration, f->fingerprint) != digest)
        status = checkpoint_file_damaged(f, "the digest of its tiles does not match", err);
    f->complete = status == STATUS_OK;
    return status;
}

void checkpoint_file_forget(struct checkpoint_file *f) {
    checkpoint_file_release(f->array, f->array_count);
    mem_free(f->program);
    f->program = NULL;
    f->array = NULL;
    f->array_count = 0;
    f->complete = false;
    f->next_row = 1;
}

/* The journal first: it must not meet a new database. */
static enum status remove_file(const char *path, struct error *err) {
    static const char *const suffixes[] = {"-journal", "-wal", "-shm", ""};
    enum status status = STATUS_OK;
    for (size_t i = 0; i < sizeof suffixes / sizeof suffixes[0] && status == STATUS_OK; i++) {
        char *name = mem_printf("%s%s", path, suffixes[i]);
        status = file_remove_tree(name, err);
        mem_free(name);
    }
    return status;
}

/* Where SQLite cannot create a file it tries to open it read-only and reports that error. Both files are created
 * here, so that a full disk is reported as such; empty files are an empty database and no journal. */
static enum status open_file(struct checkpoint_file *f, const char *path, struct error *err) {
    static const char *const suffixes[] = {"", "-journal"};
    enum status status = STATUS_OK;
    for (size_t i = 0; i < sizeof suffixes / sizeof suffixes[0] && status == STATUS_OK; i++) {
        char *name = mem_printf("%s%s", path, suffixes[i]);
        int fd = open(name, O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
        if (fd < 0)
            status = error_set_errno(err, errno, "cannot open %s", name);
        else
            close(fd);
        mem_free(name);
    }
    return status == STATUS_OK ? sql_open(&f->sql, path, SQL_ROLLBACK, PAGE_SIZE, err) : status;
}

enum status checkpoint_file_open(struct checkpoint_file *f, const char *path, const char *fingerprint, char note[512],
                                 struct error *err) {
    note[0] = '\0';
    *f = (struct checkpoint_file){.fingerprint = mem_strdup(fingerprint), .next_row = 1};
    struct error first;
    enum status status = open_file(f, path, &first);
    if (status == STATUS_OK)
        status = read_commit(f, note, &first);
    /* A damaged schema makes our statements invalid: STATUS_INTERNAL. */
    if (status == STATUS_CORRUPT || status == STATUS_INTERNAL)
        snprintf(note, 512, "the checkpoint cannot be used: %.400s", first.message);
    else if (status != STATUS_OK && err)
        *err = first;
    if (note[0]) {
        checkpoint_file_forget(f);
        if (f->sql.db)
            sql_close(&f->sql);
        status = remove_file(path, err);
        if (status == STATUS_OK)
            status = open_file(f, path, err);
        if (status == STATUS_OK)
            status = create_tables(f, err);
    }
    if (status != STATUS_OK)
        checkpoint_file_close(f);
    return status;
}

void checkpoint_file_close(struct checkpoint_file *f) {
    checkpoint_file_release(f->array, f->array_count);
    if (f->sql.db)
        sql_close(&f->sql);
    mem_free(f->program);
    mem_free(f->fingerprint);
    *f = (struct checkpoint_file){0};
}
