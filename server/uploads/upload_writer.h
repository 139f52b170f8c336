/* upload_writer.h -- one request's right to write to an upload in parts. One request at a time has it; a newer
 * one that names the right offset takes it away: the older is dead or about to find out. Bytes go to disk
 * under the upload's mutex, so the two never mix. All functions are thread-safe; one writer is for one
 * thread at a time. */
#ifndef UNBAKE_UPLOADS_UPLOAD_WRITER_H
#define UNBAKE_UPLOADS_UPLOAD_WRITER_H

#include "server/uploads/resumable.h"

struct upload_writer; /* opaque */

/* The right to write from `offset` on. STATUS_CONFLICT when that is not where the upload stands.
 * is_checked: what is written does not count before upload_writer_accept. */
enum status upload_writer_take(struct resumables *r, const char *id, uint64_t offset, bool is_checked,
                               struct upload_writer **out, struct error *err);
/* STATUS_CONFLICT: another request has taken over; STATUS_LIMIT: more than the whole. */
enum status upload_writer_write(struct upload_writer *w, const void *data, uint64_t length, struct error *err);
uint64_t upload_writer_room(const struct upload_writer *w);       /* what may still be written */
uint64_t upload_writer_unreserved(const struct upload_writer *w); /* of that, what the disk has not set aside */
bool upload_writer_is_due(const struct upload_writer *w);         /* much was written since the last commit */
enum status upload_writer_accept(struct upload_writer *w, struct error *err);
/* What was written is on disk and counted. */
enum status upload_writer_commit(struct upload_writer *w, struct error *err);
/* The same, and the row as resumable_status gives it. STATUS_CONFLICT: some of it was lost, and is to be sent again. */
enum status upload_writer_finish(struct upload_writer *w, struct upload_row *row, struct error *err);
void upload_writer_release(struct upload_writer *w); /* NULL is fine; frees it */

#endif
