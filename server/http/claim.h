/* claim.h -- one request's right to write to an upload in parts. One request at a time has it; a newer
 * one that names the right offset takes it away: the older is dead or about to find out. Bytes go to disk
 * under the upload's mutex, so the two never mix. All functions are thread-safe; one claim is for one
 * thread at a time. */
#ifndef UNBAKE_HTTP_CLAIM_H
#define UNBAKE_HTTP_CLAIM_H

#include "server/http/partial.h"

struct claim; /* opaque */

/* The right to write from `offset` on. STATUS_CONFLICT when that is not where the upload stands.
 * is_checked: what is written does not count before claim_accept. */
enum status claim_take(struct partials *p, const char *id, uint64_t offset, bool is_checked, struct claim **out,
                       struct error *err);
/* STATUS_CONFLICT: another request has taken over; STATUS_LIMIT: more than the whole. */
enum status claim_write(struct claim *c, const void *data, uint64_t length, struct error *err);
uint64_t claim_room(const struct claim *c);       /* what may still be written */
uint64_t claim_unreserved(const struct claim *c); /* of that, what the disk has not set aside */
bool claim_is_due(const struct claim *c);         /* much was written since the last commit */
enum status claim_accept(struct claim *c, struct error *err);
/* What was written is on disk and counted. */
enum status claim_commit(struct claim *c, struct error *err);
/* The same, and the row as partial_look gives it. STATUS_CONFLICT: some of it was lost, and is to be sent again. */
enum status claim_finish(struct claim *c, struct upload_row *row, struct error *err);
void claim_release(struct claim *c); /* NULL is fine; frees it */

#endif
