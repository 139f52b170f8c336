/* resumable.h -- uploads in parts, on disk: what is safe, what becomes of them. Who may write: upload_writer.h.
 *
 *      created ──take, write ...──> whole ──finish──> a scene        (or removed, or expired)
 *                  ^         │
 *                  └─────────┘ cut off, daemon restarted: goes on where it was
 *
 * 1. `received` in the store counts bytes that are on disk (fdatasync before the row): what is
 *    acknowledged is never lost. It only grows.
 * 2. One request at a time writes (upload_writer.h).
 * 3. A daemon that was killed leaves bytes in the file that no row counts. They are hashed and
 *    counted when the upload is next looked at, provided that the machine has run on since (its
 *    boot id says so): then the kernel has kept them. After a power cut they are cut off.
 * 4. All of the space is reserved when the upload is created, and given back when nothing has arrived for
 *    resumables_config.idle_ms: such an upload goes on while the disk has room.
 * 5. A file that is whole moves to DATA/scenes/ID/archive, then the scene's row is made, then the
 *    upload's row names it. resumables_recover goes on from any point in between.
 *
 * All functions are thread-safe. */
#ifndef UNBAKE_UPLOADS_RESUMABLE_H
#define UNBAKE_UPLOADS_RESUMABLE_H

#include "common/error.h"
#include "server/store/store.h"
#include "server/uploads/resumables_config.h"

struct resumables; /* the uploads that are in use; opaque */

struct resumables *resumables_new(const struct resumables_config *config);
void resumables_free(struct resumables *r); /* counts first what is in files but not yet in the store */
/* Repairs what an earlier run left: finishes complete uploads. Call before files without rows are removed. */
enum status resumables_recover(struct resumables *r, struct error *err);
/* Counts what interrupted requests wrote; frees space that idle uploads reserve beyond what has arrived. Call from
 * time to time. */
void resumables_maintain(struct resumables *r);

/* Creates an upload from owner_id, name, metadata, sha256 and length of *row; fills the rest except times. Reserves
 * the space: STATUS_NO_SPACE. user_max: unfinished uploads of one user; 0: no limit. */
enum status resumable_create(struct resumables *r, struct upload_row *row, size_t user_max, struct error *err);

/* The row after everything received was counted and, if the upload is complete, finished. */
enum status resumable_status(struct resumables *r, const char *id, struct upload_row *row, struct error *err);

/* Removes the upload and its file, even while somebody writes to it. */
enum status resumable_remove(struct resumables *r, const char *id, struct error *err);
/* The same where the row is gone already. */
enum status resumable_remove_files(struct resumables *r, const char *id, struct error *err);

#endif
