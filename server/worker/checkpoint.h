/* checkpoint.h -- checkpoint.db: all that a later attempt needs, in one SQLite transaction.
 *
 * 1. A save is committed whole or not at all; until then, and after any failure or crash, the
 *    one before is what a load finds.
 * 2. Arrays are cut into tiles of CHECKPOINT_TILE_BYTES. A tile whose hash has not changed since
 *    it was last written is not written again. New versions of tiles are inserted and the old
 *    rows then deleted, so that bytes go to free or appended pages, which the rollback journal
 *    need not copy: every byte is written once. (A write-ahead log writes it twice: for 671 MB,
 *    all of it changed, 2.4 s against 1.8 s, where a plain stream and fsync took 0.4 to 2.3 s,
 *    and the log's own 671 MB stay on the disk.) The file grows to about twice the state.
 * 3. Each tile carries its hash, and a digest binds all of them, the iteration and the
 *    fingerprint. Opening reads everything; damage is noted and the file removed: the attempt
 *    then starts from the beginning, never from a state that is half wrong.
 * 4. The file has the format of the state in it (STATE_FORMAT), not the program's version. One of an older format is
 *    read, array by array by their names; the next save makes it one of today's.
 * 5. Parts (checkpoint_parts.h) that another machine has sent lie beside the file: opening takes them into it.
 * 6. One connection, holding an exclusive lock while it is open: of a stale and a new worker only
 *    one can ever write.
 *
 * Not thread-safe. */
#ifndef UNBAKE_WORKER_CHECKPOINT_H
#define UNBAKE_WORKER_CHECKPOINT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "server/state/state_array.h"

struct checkpoint; /* opaque */
struct written_part;

/* Opens or creates the file. `fingerprint` identifies what the state depends on (scene, settings): a checkpoint with
 * another one is removed. note[0] is 0, or a sentence for the user on why an existing checkpoint is not used.
 * STATUS_UNAVAILABLE when another process has it. */
enum status checkpoint_open(struct checkpoint **checkpoint, const char *path, const char *fingerprint, char note[512],
                            struct error *err);
void checkpoint_close(struct checkpoint *checkpoint);
/* From now on checkpoint_write_part works. */
void checkpoint_send_parts(struct checkpoint *checkpoint);

struct checkpoint_cost {
    size_t tile_count, written_tile_count;
    uint64_t written_bytes; /* in tiles */
    double seconds;
};

/* Commits the arrays (names unique) as the newest checkpoint. cost may be NULL. */
enum status checkpoint_save(struct checkpoint *checkpoint, long iteration, const struct state_array *array,
                            size_t count, struct checkpoint_cost *cost, struct error *err);

/* Writes a part of the arrays, which have just been saved, for another machine; part->number 0: none, as the one before
 * has not been taken away yet (`must`: in spite of that), or none are wanted. */
enum status checkpoint_write_part(struct checkpoint *checkpoint, const struct state_array *array, size_t count,
                                  bool must, struct written_part *part, struct error *err);

/* Fills the arrays. Without a checkpoint *found is false and nothing changes. With one of an older format, arrays
 * that it cannot have keep their content. STATUS_CORRUPT, and nothing changes, when other arrays are missing, sizes
 * differ, or STATE_SURFACE does. */
enum status checkpoint_load(struct checkpoint *checkpoint, struct state_array *array, size_t count, bool *found,
                            long *iteration, struct error *err);
/* A sentence for the user on what the last load dropped, and from which format; "" if nothing. Borrowed. */
const char *checkpoint_note(const struct checkpoint *checkpoint);

/* Removes the stored state, because its reader cannot use it. */
enum status checkpoint_clear(struct checkpoint *checkpoint, struct error *err);

#endif
