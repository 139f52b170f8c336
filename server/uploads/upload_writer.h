/* upload_writer.h -- one request's right to write to an upload in parts. One request at a time has it; a newer
 * one that names the right offset takes it away: the older is dead or about to find out. Bytes go to disk
 * under the upload's mutex, so the two never mix. All functions are thread-safe; one writer is for one
 * thread at a time. */
#ifndef UNBAKE_UPLOADS_UPLOAD_WRITER_H
#define UNBAKE_UPLOADS_UPLOAD_WRITER_H

#include "server/uploads/resumable.h"

struct upload_writer; /* opaque */

/* Acquires the right to write from `offset` on. STATUS_CONFLICT when the upload stands elsewhere. is_checked: what
 * is written does not count before upload_writer_accept. */
enum status upload_writer_take(struct resumables *r, const char *id, uint64_t offset, bool is_checked,
                               struct upload_writer **out, struct error *err);
/* STATUS_CONFLICT: another request has taken over; STATUS_LIMIT: beyond the upload's length. */
enum status upload_writer_write(struct upload_writer *w, const void *data, uint64_t length, struct error *err);
uint64_t upload_writer_room(const struct upload_writer *w);       /* bytes that may still be written */
uint64_t upload_writer_unreserved(const struct upload_writer *w); /* of those, bytes without allocated space */
bool upload_writer_is_due(const struct upload_writer *w);         /* much was written since the last commit */
enum status upload_writer_accept(struct upload_writer *w, struct error *err);
/* Syncs and counts what was written. */
enum status upload_writer_commit(struct upload_writer *w, struct error *err);
/* The same, then the row as from resumable_status. STATUS_CONFLICT: some of it was lost and must be sent again. */
enum status upload_writer_finish(struct upload_writer *w, struct upload_row *row, struct error *err);
void upload_writer_release(struct upload_writer *w); /* frees it; NULL is allowed */

#endif
