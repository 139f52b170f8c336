/* checkpoint.c -- see checkpoint.h.
 *
 * In memory stands, for every tile of the newest commit, its row and its hash: what a save
 * compares with and a load reads by. */
#include "server/worker/checkpoint.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "server/store/sql.h"
#include "common/hash64.h"

/* SQLite's largest page: a tile is a chain of 16 pages, not of 256. */
#define PAGE_SIZE 65536

struct checkpoint_tile {
    int64_t row; /* 0: none */
    uint64_t hash;
};

struct stored_array {
    char *name;
    size_t bytes, tile_count;
    struct checkpoint_tile *tile;
};

struct checkpoint {
    struct sql sql;
    char *fingerprint;
    bool complete; /* there is a commit, described below */
    int format;    /* of the file */
    char *program; /* version that wrote it */
    char note[512];
    long iteration;
    size_t array_count;
    struct stored_array *array;
    int64_t next_row;
};

static size_t tile_count_of(size_t bytes) { return (bytes + CHECKPOINT_TILE_BYTES - 1) / CHECKPOINT_TILE_BYTES; }

static size_t tile_bytes(size_t array_bytes, size_t tile) {
    size_t left = array_bytes - tile * CHECKPOINT_TILE_BYTES;
    return left < CHECKPOINT_TILE_BYTES ? left : CHECKPOINT_TILE_BYTES;
}

static void arrays_release(struct stored_array *array, size_t count) {
    for (size_t i = 0; i < count; i++) {
        mem_free(array[i].name);
        mem_free(array[i].tile);
    }
    mem_free(array);
}

/* A digest of all hashes, in order, and of everything else a load relies on. */
static uint64_t digest_of(const struct stored_array *array, size_t count, long iteration, const char *fingerprint) {
    uint64_t digest = hash64(fingerprint, strlen(fingerprint), (uint64_t)iteration);
    for (size_t i = 0; i < count; i++) {
        digest = hash64(array[i].name, strlen(array[i].name) + 1, digest);
        for (size_t t = 0; t < array[i].tile_count; t++)
            digest = hash64(&array[i].tile[t].hash, sizeof(uint64_t), digest);
        digest = hash64(&array[i].bytes, sizeof array[i].bytes, digest);
    }
    return digest;
}

/* --- opening ------------------------------------------------------------------------------ */

/* Within a transaction. */
static enum status write_format(struct checkpoint *c, struct error *err) {
    char text[48];
    snprintf(text, sizeof text, "PRAGMA user_version=%d", STATE_FORMAT);
    return sql_script(&c->sql, text, err);
}

static enum status create_tables(struct checkpoint *c, struct error *err) {
    enum status status = sql_begin(&c->sql, err);
    if (status != STATUS_OK)
        return status;
    status = sql_script(&c->sql,
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
        status = write_format(c, err);
    return sql_end(&c->sql, status, err);
}

static enum status damaged(struct checkpoint *c, const char *what, struct error *err) {
    return error_set(err, STATUS_CORRUPT, "%s: %s", c->sql.path, what);
}

static enum status read_arrays(struct checkpoint *c, struct error *err) {
    sqlite3_stmt *stmt;
    enum status status = sql_query(&c->sql, &stmt, err, "SELECT number, name, bytes FROM arrays ORDER BY number", "");
    bool row = status == STATUS_OK;
    while (row) {
        status = sql_step(&c->sql, stmt, &row, err);
        if (!row)
            break;
        int64_t bytes = sqlite3_column_int64(stmt, 2);
        if (sqlite3_column_int64(stmt, 0) != (int64_t)c->array_count || bytes < 0 ||
            (uint64_t)bytes > (uint64_t)1 << 44) {
            sqlite3_reset(stmt);
            return damaged(c, "its list of arrays makes no sense", err);
        }
        c->array = mem_realloc_array(c->array, c->array_count + 1, sizeof *c->array);
        size_t tiles = tile_count_of((size_t)bytes);
        c->array[c->array_count++] = (struct stored_array){
            .name = sql_dup(stmt, 1),
            .bytes = (size_t)bytes,
            .tile_count = tiles,
            .tile = mem_calloc(tiles ? tiles : 1, sizeof(struct checkpoint_tile)),
        };
    }
    return status;
}

/* Reads every tile and checks its position, size and hash. */
static enum status read_tiles(struct checkpoint *c, struct error *err) {
    sqlite3_stmt *stmt;
    enum status status = sql_query(&c->sql, &stmt, err, "SELECT id, array, number, hash, data FROM tiles", "");
    bool row = status == STATUS_OK;
    while (row) {
        status = sql_step(&c->sql, stmt, &row, err);
        if (!row)
            break;
        uint64_t a = (uint64_t)sqlite3_column_int64(stmt, 1);
        uint64_t t = (uint64_t)sqlite3_column_int64(stmt, 2);
        struct checkpoint_tile found = {.row = sqlite3_column_int64(stmt, 0),
                                        .hash = (uint64_t)sqlite3_column_int64(stmt, 3)};
        bool fits = a < c->array_count && t < c->array[a].tile_count && c->array[a].tile[t].row == 0;
        if (fits) {
            size_t bytes = tile_bytes(c->array[a].bytes, t);
            const void *data = sqlite3_column_blob(stmt, 4);
            fits = data && (size_t)sqlite3_column_bytes(stmt, 4) == bytes && hash64(data, bytes, 0) == found.hash;
        }
        if (!fits) {
            sqlite3_reset(stmt);
            return damaged(c, "a tile fails its check", err);
        }
        c->array[a].tile[t] = found;
        if (found.row >= c->next_row)
            c->next_row = found.row + 1;
    }
    for (size_t a = 0; status == STATUS_OK && a < c->array_count; a++)
        for (size_t t = 0; t < c->array[a].tile_count; t++)
            if (c->array[a].tile[t].row == 0)
                return damaged(c, "a tile is missing", err);
    return status;
}

/* Reads and verifies the commit. note[0] is set when it cannot be used. */
static enum status read_commit(struct checkpoint *c, char note[512], struct error *err) {
    int64_t version, table_count;
    enum status status = sql_int(&c->sql, 0, &version, err, "PRAGMA user_version", "");
    if (status == STATUS_OK)
        status = sql_int(&c->sql, 0, &table_count, err, "SELECT count(*) FROM sqlite_schema", "");
    if (status == STATUS_OK && version == 0 && table_count == 0)
        return create_tables(c, err);
    if (status == STATUS_OK && (version < 1 || version > STATE_FORMAT))
        snprintf(note, 512, "the checkpoint has format %lld, this program reads up to %d", (long long)version,
                 STATE_FORMAT);
    if (status != STATUS_OK || note[0])
        return status;
    sqlite3_stmt *stmt;
    bool row;
    uint64_t digest = 0;
    status = sql_query(&c->sql, &stmt, err, "SELECT fingerprint, iteration, digest, program FROM newest", "");
    if (status == STATUS_OK)
        status = sql_step(&c->sql, stmt, &row, err);
    if (status != STATUS_OK || !row)
        return status;
    bool same = strcmp(sql_text(stmt, 0), c->fingerprint) == 0;
    c->iteration = (long)sqlite3_column_int64(stmt, 1);
    digest = (uint64_t)sqlite3_column_int64(stmt, 2);
    c->format = (int)version;
    c->program = sql_dup(stmt, 3);
    sqlite3_reset(stmt);
    if (!same) {
        snprintf(note, 512, "the checkpoint belongs to another scene, another reading of it or other settings");
        return STATUS_OK;
    }
    status = read_arrays(c, err);
    if (status == STATUS_OK)
        status = read_tiles(c, err);
    if (status == STATUS_OK && digest_of(c->array, c->array_count, c->iteration, c->fingerprint) != digest)
        status = damaged(c, "the digest of its tiles does not match", err);
    c->complete = status == STATUS_OK;
    return status;
}

static void forget(struct checkpoint *c) {
    arrays_release(c->array, c->array_count);
    mem_free(c->program);
    c->program = NULL;
    c->array = NULL;
    c->array_count = 0;
    c->complete = false;
    c->next_row = 1;
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
static enum status open_file(struct checkpoint *c, const char *path, struct error *err) {
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
    return status == STATUS_OK ? sql_open(&c->sql, path, SQL_ROLLBACK, PAGE_SIZE, err) : status;
}

enum status checkpoint_open(struct checkpoint **out, const char *path, const char *fingerprint, char note[512],
                            struct error *err) {
    *out = NULL;
    note[0] = '\0';
    struct checkpoint *c = mem_calloc(1, sizeof *c);
    c->fingerprint = mem_strdup(fingerprint);
    c->next_row = 1;
    struct error first;
    enum status status = open_file(c, path, &first);
    if (status == STATUS_OK)
        status = read_commit(c, note, &first);
    /* A damaged schema makes our statements invalid: STATUS_INTERNAL. */
    if (status == STATUS_CORRUPT || status == STATUS_INTERNAL)
        snprintf(note, 512, "the checkpoint cannot be used: %.400s", first.message);
    else if (status != STATUS_OK && err)
        *err = first;
    if (note[0]) {
        forget(c);
        if (c->sql.db)
            sql_close(&c->sql);
        status = remove_file(path, err);
        if (status == STATUS_OK)
            status = open_file(c, path, err);
        if (status == STATUS_OK)
            status = create_tables(c, err);
    }
    if (status != STATUS_OK)
        checkpoint_close(c);
    else
        *out = c;
    return status;
}

void checkpoint_close(struct checkpoint *c) {
    if (!c)
        return;
    arrays_release(c->array, c->array_count);
    if (c->sql.db)
        sql_close(&c->sql);
    mem_free(c->program);
    mem_free(c->fingerprint);
    mem_free(c);
}

/* --- saving --------------------------------------------------------------------------------- */

static bool same_arrays(const struct checkpoint *c, const struct state_array *array, size_t count) {
    bool same = c->complete && c->array_count == count;
    for (size_t i = 0; same && i < count; i++)
        same = c->array[i].bytes == array[i].bytes && strcmp(c->array[i].name, array[i].name) == 0;
    return same;
}

/* The index for `array`, with the rows and hashes of the newest commit if it holds the same arrays. */
static struct stored_array *next_index(const struct checkpoint *c, const struct state_array *array, size_t count,
                                       bool same) {
    struct stored_array *next = mem_calloc(count ? count : 1, sizeof *next);
    for (size_t i = 0; i < count; i++) {
        size_t tiles = tile_count_of(array[i].bytes);
        next[i] = (struct stored_array){
            .name = mem_strdup(array[i].name),
            .bytes = array[i].bytes,
            .tile_count = tiles,
            .tile = mem_calloc(tiles ? tiles : 1, sizeof(struct checkpoint_tile)),
        };
        if (same && tiles)
            memcpy(next[i].tile, c->array[i].tile, tiles * sizeof(struct checkpoint_tile));
    }
    return next;
}

/* Inserts the changed tiles of one array; *row is the next free row number. */
static enum status insert_tiles(struct checkpoint *c, const struct state_array *array, size_t number,
                                struct stored_array *next, int64_t *row, struct checkpoint_cost *cost,
                                struct error *err) {
    enum status status = STATUS_OK;
    for (size_t t = 0; t < next->tile_count && status == STATUS_OK; t++) {
        const char *data = (const char *)array->data + t * CHECKPOINT_TILE_BYTES;
        size_t bytes = tile_bytes(array->bytes, t);
        uint64_t hash = hash64(data, bytes, 0);
        cost->tile_count++;
        if (next->tile[t].row != 0 && next->tile[t].hash == hash)
            continue;
        next->tile[t] = (struct checkpoint_tile){.row = (*row)++, .hash = hash};
        cost->written_tile_count++;
        cost->written_bytes += bytes;
        status =
            sql_run(&c->sql, err, "INSERT INTO tiles (id, array, number, hash, data) VALUES (?, ?, ?, ?, ?)", "iiiib",
                    next->tile[t].row, (int64_t)number, (int64_t)t, (int64_t)hash, (const void *)data, bytes);
    }
    return status;
}

/* Deletes rows of the newest commit that `next` no longer uses. */
static enum status delete_replaced(struct checkpoint *c, const struct stored_array *next, bool same,
                                   struct error *err) {
    enum status status = STATUS_OK;
    for (size_t i = 0; i < c->array_count; i++)
        for (size_t t = 0; t < c->array[i].tile_count && status == STATUS_OK; t++)
            if (!same || next[i].tile[t].row != c->array[i].tile[t].row)
                status = sql_run(&c->sql, err, "DELETE FROM tiles WHERE id = ?", "i", c->array[i].tile[t].row);
    return status;
}

static enum status write_heads(struct checkpoint *c, long iteration, const struct stored_array *next, size_t count,
                               bool same, struct error *err) {
    enum status status = STATUS_OK;
    if (!same)
        status = sql_run(&c->sql, err, "DELETE FROM arrays", "");
    for (size_t i = 0; !same && i < count && status == STATUS_OK; i++)
        status = sql_run(&c->sql, err, "INSERT INTO arrays (number, name, bytes) VALUES (?, ?, ?)", "iti", (int64_t)i,
                         next[i].name, (int64_t)next[i].bytes);
    if (status == STATUS_OK)
        status = sql_run(&c->sql, err,
                         "INSERT OR REPLACE INTO newest (id, fingerprint, program, iteration,"
                         " digest) VALUES (1, ?, ?, ?, ?)",
                         "ttii", c->fingerprint, UNBAKE_VERSION, (int64_t)iteration,
                         (int64_t)digest_of(next, count, iteration, c->fingerprint));
    return status == STATUS_OK ? write_format(c, err) : status;
}

enum status checkpoint_save(struct checkpoint *c, long iteration, const struct state_array *array, size_t count,
                            struct checkpoint_cost *cost, struct error *err) {
    struct checkpoint_cost spent = {0};
    double start = clock_sec();
    enum status status = sql_begin(&c->sql, err);
    if (status != STATUS_OK)
        return status;
    bool same = same_arrays(c, array, count);
    struct stored_array *next = next_index(c, array, count, same);
    int64_t row = c->next_row;
    for (size_t i = 0; i < count && status == STATUS_OK; i++)
        status = insert_tiles(c, &array[i], i, &next[i], &row, &spent, err);
    if (status == STATUS_OK)
        status = delete_replaced(c, next, same, err);
    if (status == STATUS_OK)
        status = write_heads(c, iteration, next, count, same, err);
    status = sql_end(&c->sql, status, err);
    if (status != STATUS_OK) {
        arrays_release(next, count);
        return status;
    }
    arrays_release(c->array, c->array_count);
    c->array = next;
    c->array_count = count;
    c->next_row = row;
    c->iteration = iteration;
    c->format = STATE_FORMAT;
    c->complete = true;
    spent.seconds = clock_sec() - start;
    if (cost)
        *cost = spent;
    return STATUS_OK;
}

/* --- loading ---------------------------------------------------------------------------------- */

static enum status load_tile(struct checkpoint *c, const struct checkpoint_tile *tile, void *to, size_t bytes,
                             struct error *err) {
    sqlite3_stmt *stmt;
    bool row;
    enum status status = sql_query(&c->sql, &stmt, err, "SELECT data FROM tiles WHERE id = ?", "i", tile->row);
    if (status == STATUS_OK)
        status = sql_step(&c->sql, stmt, &row, err);
    if (status != STATUS_OK)
        return status;
    const void *data = row ? sqlite3_column_blob(stmt, 0) : NULL;
    if (data && (size_t)sqlite3_column_bytes(stmt, 0) == bytes) {
        memcpy(to, data, bytes);
        if (hash64(to, bytes, 0) != tile->hash)
            status = STATUS_CORRUPT;
    } else {
        status = STATUS_CORRUPT;
    }
    sqlite3_reset(stmt);
    /* It was intact when the file was opened: the device or the memory is faulty. */
    return status == STATUS_OK ? status : error_set(err, STATUS_IO, "%s: a tile read twice differs", c->sql.path);
}

/* The stored array with that name; NULL: none. */
static const struct stored_array *stored_named(const struct checkpoint *c, const char *name) {
    for (size_t i = 0; i < c->array_count; i++)
        if (strcmp(c->array[i].name, name) == 0)
            return &c->array[i];
    return NULL;
}

static enum status load_array(struct checkpoint *c, const struct stored_array *from, void *to, struct error *err) {
    enum status status = STATUS_OK;
    for (size_t t = 0; t < from->tile_count && status == STATUS_OK; t++)
        status = load_tile(c, &from->tile[t], (char *)to + t * CHECKPOINT_TILE_BYTES, tile_bytes(from->bytes, t), err);
    return status;
}

static enum status check_surface(struct checkpoint *c, const struct stored_array *from, const struct state_array *now,
                                 struct error *err) {
    void *stored = mem_alloc(from->bytes ? from->bytes : 1);
    enum status status = load_array(c, from, stored, err);
    bool same = status == STATUS_OK && memcmp(stored, now->data, now->bytes) == 0;
    mem_free(stored);
    return status != STATUS_OK || same ? status : damaged(c, "this program lays textures out in another way", err);
}

/* Checks that all wanted arrays are there, with the wanted sizes. */
static enum status check_arrays(struct checkpoint *c, const struct state_array *array, size_t count,
                                struct error *err) {
    enum status status = STATUS_OK;
    for (size_t i = 0; i < count && status == STATUS_OK; i++) {
        const struct stored_array *from = stored_named(c, array[i].name);
        if (!from && array[i].since <= c->format)
            status = error_set(err, STATUS_CORRUPT, "%s has no %s", c->sql.path, array[i].name);
        else if (from && from->bytes != array[i].bytes)
            status = error_set(err, STATUS_CORRUPT, "%s has %zu bytes of %s, not %zu", c->sql.path, from->bytes,
                               array[i].name, array[i].bytes);
        else if (from && strcmp(array[i].name, STATE_SURFACE) == 0)
            status = check_surface(c, from, &array[i], err);
    }
    return status;
}

/* Notes which arrays of an older format are no longer used. */
static void note_dropped(struct checkpoint *c, const struct state_array *array, size_t count) {
    const size_t size = sizeof c->note;
    size_t used = 0;
    for (size_t s = 0; s < c->array_count && used < size; s++) {
        size_t i = 0;
        while (i < count && strcmp(array[i].name, c->array[s].name) != 0)
            i++;
        if (i == count)
            used += (size_t)snprintf(c->note + used, size - used, "%s%s",
                                     used ? ", " : "dropped of the checkpoint: ", c->array[s].name);
    }
    if (used < size && c->format < STATE_FORMAT)
        snprintf(c->note + used, size - used, "%sthe checkpoint is of format %d, by unbaked %.40s; %s",
                 used ? "; " : "", c->format, c->program, used ? "the rest of it is used" : "all of it is used");
}

enum status checkpoint_load(struct checkpoint *c, struct state_array *array, size_t count, bool *found, long *iteration,
                            struct error *err) {
    *found = false;
    c->note[0] = '\0';
    if (!c->complete)
        return STATUS_OK;
    enum status status = check_arrays(c, array, count, err);
    for (size_t i = 0; i < count && status == STATUS_OK; i++) {
        const struct stored_array *from = stored_named(c, array[i].name);
        if (from)
            status = load_array(c, from, array[i].data, err);
    }
    if (status != STATUS_OK)
        return status;
    note_dropped(c, array, count);
    *found = true;
    *iteration = c->iteration;
    return STATUS_OK;
}

const char *checkpoint_note(const struct checkpoint *c) { return c->note; }

enum status checkpoint_clear(struct checkpoint *c, struct error *err) {
    enum status status = sql_begin(&c->sql, err);
    if (status != STATUS_OK)
        return status;
    status = sql_script(&c->sql, "DELETE FROM newest; DELETE FROM arrays; DELETE FROM tiles", err);
    status = sql_end(&c->sql, status, err);
    if (status == STATUS_OK)
        forget(c);
    return status;
}
