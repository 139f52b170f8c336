/* checkpoint_file.h -- checkpoint.db as it lies on the disk: its tables, opened and verified. What is saved and loaded
 * is checkpoint.c's.
 *
 *   newest   one row: fingerprint, program, iteration, digest       user_version is the format (STATE_FORMAT)
 *   arrays   number, name, bytes
 *   tiles    id, array, number, hash, data
 *
 * In memory stands, for every tile of the newest commit, its row and its hash: what a save compares with and a load
 * reads by. */
#ifndef UNBAKE_WORKER_CHECKPOINT_FILE_H
#define UNBAKE_WORKER_CHECKPOINT_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "server/store/sql.h"

#define CHECKPOINT_TILE_BYTES ((size_t)1 << 20) /* of an array; what changed is written tile by tile */

struct checkpoint_tile {
    int64_t row; /* 0: none */
    uint64_t hash;
};

struct stored_array {
    char *name;
    size_t bytes, tile_count;
    struct checkpoint_tile *tile;
};

struct checkpoint_file {
    struct sql sql;
    char *fingerprint;
    bool complete; /* there is a commit, described below */
    int format;    /* of the file */
    char *program; /* version that wrote it */
    long iteration;
    size_t array_count;
    struct stored_array *array;
    int64_t next_row;
};

/* Opens or creates the file, and reads and verifies all of it. note[0] is 0, or a sentence for the user on why what was
 * there is not used; it is removed then. STATUS_UNAVAILABLE when another process has it. After a failure *f is
 * empty. */
enum status checkpoint_file_open(struct checkpoint_file *f, const char *path, const char *fingerprint, char note[512],
                                 struct error *err);
void checkpoint_file_close(struct checkpoint_file *f);
/* The tables have been emptied: there is no commit. */
void checkpoint_file_forget(struct checkpoint_file *f);
/* Within a transaction: makes the file one of today's format. */
enum status checkpoint_file_write_format(struct checkpoint_file *f, struct error *err);
enum status checkpoint_file_damaged(struct checkpoint_file *f, const char *what,
                                    struct error *err); /* STATUS_CORRUPT */

size_t checkpoint_file_tile_count(size_t array_bytes);
size_t checkpoint_file_tile_bytes(size_t array_bytes, size_t tile); /* the last one may be shorter */
void checkpoint_file_release(struct stored_array *array, size_t count);
/* Of all hashes, in order, and of everything else that a load relies on. */
uint64_t checkpoint_file_digest(const struct stored_array *array, size_t count, long iteration,
                                const char *fingerprint);

#endif
