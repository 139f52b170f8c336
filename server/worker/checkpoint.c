/* checkpoint.c -- see checkpoint.h. */
#include "server/worker/checkpoint.h"

#include <stdio.h>
#include <string.h>

#include "common/clock.h"
#include "common/hash64.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "server/worker/checkpoint_file.h"
#include "server/worker/checkpoint_parts.h"

struct checkpoint {
    struct checkpoint_file file;
    char *dir;                      /* the file's */
    int next_part;                  /* number of the next part */
    struct checkpoint_parts *parts; /* NULL: none are written */
    char note[512];
};

enum status checkpoint_open(struct checkpoint **out, const char *path, const char *fingerprint, char note[512],
                            struct error *err) {
    struct checkpoint *checkpoint = mem_calloc(1, sizeof *checkpoint);
    char remark[512];
    enum status status = checkpoint_file_open(&checkpoint->file, path, fingerprint, note, err);
    if (status == STATUS_OK) {
        const char *slash = strrchr(path, '/');
        checkpoint->dir = slash ? mem_strndup(path, (size_t)(slash - path)) : mem_strdup(".");
        status = checkpoint_parts_take(&checkpoint->file, checkpoint->dir, &checkpoint->next_part, remark, err);
        if (status == STATUS_OK && !note[0])
            memcpy(note, remark, sizeof remark);
    }
    *out = status == STATUS_OK ? checkpoint : NULL;
    if (status != STATUS_OK)
        checkpoint_close(checkpoint);
    return status;
}

void checkpoint_close(struct checkpoint *checkpoint) {
    if (!checkpoint)
        return;
    checkpoint_file_close(&checkpoint->file);
    checkpoint_parts_free(checkpoint->parts);
    mem_free(checkpoint->dir);
    mem_free(checkpoint);
}

void checkpoint_send_parts(struct checkpoint *checkpoint) {
    checkpoint->parts = checkpoint_parts_new(checkpoint->dir, checkpoint->next_part);
}

enum status checkpoint_write_part(struct checkpoint *checkpoint, const struct state_array *array, size_t count,
                                  bool must, struct written_part *part, struct error *err) {
    *part = (struct written_part){0};
    return checkpoint->parts
               ? checkpoint_parts_write(checkpoint->parts, &checkpoint->file, array, count, must, part, err)
               : STATUS_OK;
}

/* --- saving --------------------------------------------------------------------------------- */

static bool same_arrays(const struct checkpoint_file *f, const struct state_array *array, size_t count) {
    bool same = f->complete && f->array_count == count;
    for (size_t i = 0; same && i < count; i++)
        same = f->array[i].bytes == array[i].bytes && strcmp(f->array[i].name, array[i].name) == 0;
    return same;
}

/* The index for `array`, with the rows and hashes of the newest commit if it holds the same arrays. */
static struct stored_array *next_index(const struct checkpoint_file *f, const struct state_array *array, size_t count,
                                       bool same) {
    struct stored_array *next = mem_calloc(count ? count : 1, sizeof *next);
    for (size_t i = 0; i < count; i++) {
        size_t tiles = checkpoint_file_tile_count(array[i].bytes);
        next[i] = (struct stored_array){
            .name = mem_strdup(array[i].name),
            .bytes = array[i].bytes,
            .tile_count = tiles,
            .tile = mem_calloc(tiles ? tiles : 1, sizeof(struct checkpoint_tile)),
        };
        if (same && tiles)
            memcpy(next[i].tile, f->array[i].tile, tiles * sizeof(struct checkpoint_tile));
    }
    return next;
}

/* Inserts the changed tiles of one array; *row is the next free row number. */
static enum status insert_tiles(struct checkpoint_file *f, const struct state_array *array, size_t number,
                                struct stored_array *next, int64_t *row, struct checkpoint_cost *cost,
                                struct error *err) {
    enum status status = STATUS_OK;
    for (size_t t = 0; t < next->tile_count && status == STATUS_OK; t++) {
        const char *data = (const char *)array->data + t * CHECKPOINT_TILE_BYTES;
        size_t bytes = checkpoint_file_tile_bytes(array->bytes, t);
        uint64_t hash = hash64(data, bytes, 0);
        cost->tile_count++;
        if (next->tile[t].row != 0 && next->tile[t].hash == hash)
            continue;
        next->tile[t] = (struct checkpoint_tile){.row = (*row)++, .hash = hash};
        cost->written_tile_count++;
        cost->written_bytes += bytes;
        status =
            sql_run(&f->sql, err, "INSERT INTO tiles (id, array, number, hash, data) VALUES (?, ?, ?, ?, ?)", "iiiib",
                    next->tile[t].row, (int64_t)number, (int64_t)t, (int64_t)hash, (const void *)data, bytes);
    }
    return status;
}

/* Deletes rows of the newest commit that `next` no longer uses. */
static enum status delete_replaced(struct checkpoint_file *f, const struct stored_array *next, bool same,
                                   struct error *err) {
    enum status status = STATUS_OK;
    for (size_t i = 0; i < f->array_count; i++)
        for (size_t t = 0; t < f->array[i].tile_count && status == STATUS_OK; t++)
            if (!same || next[i].tile[t].row != f->array[i].tile[t].row)
                status = sql_run(&f->sql, err, "DELETE FROM tiles WHERE id = ?", "i", f->array[i].tile[t].row);
    return status;
}

static enum status write_heads(struct checkpoint_file *f, long iteration, const struct stored_array *next, size_t count,
                               bool same, struct error *err) {
    enum status status = STATUS_OK;
    if (!same)
        status = sql_run(&f->sql, err, "DELETE FROM arrays", "");
    for (size_t i = 0; !same && i < count && status == STATUS_OK; i++)
        status = sql_run(&f->sql, err, "INSERT INTO arrays (number, name, bytes) VALUES (?, ?, ?)", "iti", (int64_t)i,
                         next[i].name, (int64_t)next[i].bytes);
    if (status == STATUS_OK)
        status = sql_run(&f->sql, err,
                         "INSERT OR REPLACE INTO newest (id, fingerprint, program, iteration,"
                         " digest) VALUES (1, ?, ?, ?, ?)",
                         "ttii", f->fingerprint, UNBAKE_VERSION, (int64_t)iteration,
                         (int64_t)checkpoint_file_digest(next, count, iteration, f->fingerprint));
    return status == STATUS_OK ? checkpoint_file_write_format(f, err) : status;
}

enum status checkpoint_save(struct checkpoint *checkpoint, long iteration, const struct state_array *array,
                            size_t count, struct checkpoint_cost *cost, struct error *err) {
    struct checkpoint_file *f = &checkpoint->file;
    struct checkpoint_cost spent = {0};
    double start = clock_sec();
    enum status status = sql_begin(&f->sql, err);
    if (status != STATUS_OK)
        return status;
    bool same = same_arrays(f, array, count);
    struct stored_array *next = next_index(f, array, count, same);
    int64_t row = f->next_row;
    for (size_t i = 0; i < count && status == STATUS_OK; i++)
        status = insert_tiles(f, &array[i], i, &next[i], &row, &spent, err);
    if (status == STATUS_OK)
        status = delete_replaced(f, next, same, err);
    if (status == STATUS_OK)
        status = write_heads(f, iteration, next, count, same, err);
    status = sql_end(&f->sql, status, err);
    if (status != STATUS_OK) {
        checkpoint_file_release(next, count);
        return status;
    }
    checkpoint_file_release(f->array, f->array_count);
    f->array = next;
    f->array_count = count;
    f->next_row = row;
    f->iteration = iteration;
    f->format = STATE_FORMAT;
    f->complete = true;
    spent.seconds = clock_sec() - start;
    if (cost)
        *cost = spent;
    return STATUS_OK;
}

/* --- loading ---------------------------------------------------------------------------------- */

static enum status load_tile(struct checkpoint_file *f, const struct checkpoint_tile *tile, void *to, size_t bytes,
                             struct error *err) {
    sqlite3_stmt *stmt;
    bool row;
    enum status status = sql_query(&f->sql, &stmt, err, "SELECT data FROM tiles WHERE id = ?", "i", tile->row);
    if (status == STATUS_OK)
        status = sql_step(&f->sql, stmt, &row, err);
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
    return status == STATUS_OK ? status : error_set(err, STATUS_IO, "%s: a tile read twice differs", f->sql.path);
}

/* The stored array with that name; NULL: none. */
static const struct stored_array *stored_named(const struct checkpoint_file *f, const char *name) {
    for (size_t i = 0; i < f->array_count; i++)
        if (strcmp(f->array[i].name, name) == 0)
            return &f->array[i];
    return NULL;
}

static enum status load_array(struct checkpoint_file *f, const struct stored_array *from, void *to, struct error *err) {
    enum status status = STATUS_OK;
    for (size_t t = 0; t < from->tile_count && status == STATUS_OK; t++)
        status = load_tile(f, &from->tile[t], (char *)to + t * CHECKPOINT_TILE_BYTES,
                           checkpoint_file_tile_bytes(from->bytes, t), err);
    return status;
}

static enum status check_surface(struct checkpoint_file *f, const struct stored_array *from,
                                 const struct state_array *now, struct error *err) {
    void *stored = mem_alloc(from->bytes ? from->bytes : 1);
    enum status status = load_array(f, from, stored, err);
    bool same = status == STATUS_OK && memcmp(stored, now->data, now->bytes) == 0;
    mem_free(stored);
    return status != STATUS_OK || same
               ? status
               : checkpoint_file_damaged(f, "this program lays textures out in another way", err);
}

/* Checks that all wanted arrays are there, with the wanted sizes. */
static enum status check_arrays(struct checkpoint_file *f, const struct state_array *array, size_t count,
                                struct error *err) {
    enum status status = STATUS_OK;
    for (size_t i = 0; i < count && status == STATUS_OK; i++) {
        const struct stored_array *from = stored_named(f, array[i].name);
        if (!from && array[i].since <= f->format)
            status = error_set(err, STATUS_CORRUPT, "%s has no %s", f->sql.path, array[i].name);
        else if (from && from->bytes != array[i].bytes)
            status = error_set(err, STATUS_CORRUPT, "%s has %zu bytes of %s, not %zu", f->sql.path, from->bytes,
                               array[i].name, array[i].bytes);
        else if (from && strcmp(array[i].name, STATE_SURFACE) == 0)
            status = check_surface(f, from, &array[i], err);
    }
    return status;
}

/* Notes which arrays of an older format are no longer used. */
static void note_dropped(struct checkpoint *checkpoint, const struct state_array *array, size_t count) {
    const struct checkpoint_file *f = &checkpoint->file;
    const size_t size = sizeof checkpoint->note;
    char *note = checkpoint->note;
    size_t used = 0;
    for (size_t s = 0; s < f->array_count && used < size; s++) {
        size_t i = 0;
        while (i < count && strcmp(array[i].name, f->array[s].name) != 0)
            i++;
        if (i == count)
            used += (size_t)snprintf(note + used, size - used, "%s%s",
                                     used ? ", " : "dropped of the checkpoint: ", f->array[s].name);
    }
    if (used < size && f->format < STATE_FORMAT)
        snprintf(note + used, size - used, "%sthe checkpoint is of format %d, by unbaked %.40s; %s", used ? "; " : "",
                 f->format, f->program, used ? "the rest of it is used" : "all of it is used");
}

enum status checkpoint_load(struct checkpoint *checkpoint, struct state_array *array, size_t count, bool *found,
                            long *iteration, struct error *err) {
    struct checkpoint_file *f = &checkpoint->file;
    *found = false;
    checkpoint->note[0] = '\0';
    if (!f->complete)
        return STATUS_OK;
    enum status status = check_arrays(f, array, count, err);
    for (size_t i = 0; i < count && status == STATUS_OK; i++) {
        const struct stored_array *from = stored_named(f, array[i].name);
        if (from)
            status = load_array(f, from, array[i].data, err);
    }
    if (status != STATUS_OK)
        return status;
    note_dropped(checkpoint, array, count);
    *found = true;
    *iteration = f->iteration;
    return STATUS_OK;
}

const char *checkpoint_note(const struct checkpoint *checkpoint) { return checkpoint->note; }

enum status checkpoint_clear(struct checkpoint *checkpoint, struct error *err) {
    struct checkpoint_file *f = &checkpoint->file;
    enum status status = sql_begin(&f->sql, err);
    if (status != STATUS_OK)
        return status;
    status = sql_script(&f->sql, "DELETE FROM newest; DELETE FROM arrays; DELETE FROM tiles", err);
    status = sql_end(&f->sql, status, err);
    if (status == STATUS_OK)
        checkpoint_file_forget(f);
    return status;
}
