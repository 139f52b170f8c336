/* checkpoint_part.h -- a checkpoint as files that are written once and never changed: what travels between machines.
 *
 *   DIR/part-N   a head, one line of JSON, then data: the tiles that have changed since the part before
 *
 *   {"number":7,"first":3,"format":3,"program":"1.2.0","fingerprint":"…","iteration":120,"digest":"HEX",
 *    "arrays":[{"name":"…","bytes":2097152,"tiles":["HASH",PART,OFFSET, "HASH",PART,OFFSET]},…]}
 *
 * 1. A head says of every tile of the checkpoint its hash, in which part it lies and where in that part's data. So the
 *    newest part and those from its `first` on are a whole checkpoint, and whoever keeps parts needs to read none.
 * 2. Hashes are those of checkpoint.db, in 16 hex digits (JSON's numbers are doubles); the digest binds all of them. */
#ifndef UNBAKE_WORKER_CHECKPOINT_PART_H
#define UNBAKE_WORKER_CHECKPOINT_PART_H

#include <stddef.h>
#include <stdint.h>

#include "common/error.h"

struct part_tile {
    uint64_t hash;
    int part;        /* number of the part that has it; 0: none yet */
    uint64_t offset; /* in its data */
};

struct part_array {
    char *name;
    size_t bytes, tile_count;
    struct part_tile *tile; /* [tile_count] */
};

struct part_head {
    int number, first;
    int format; /* of the state (STATE_FORMAT) */
    char *program, *fingerprint;
    long iteration;
    uint64_t digest;
    size_t array_count;
    struct part_array *array;
};

void part_head_release(struct part_head *head);
/* The line, with its newline; the caller's (mem_free). */
char *part_head_text(const struct part_head *head);
/* Reads the head of an open file, whose data begin at *data_start. STATUS_CORRUPT where it
 * is none. *head needs part_head_release in any case. `name` is for messages. */
enum status part_head_read(struct part_head *head, int fd, const char *name, uint64_t *data_start, struct error *err);

#endif
