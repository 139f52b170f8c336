/* outputs.h -- the files that attempts have finished writing, and their digests. As for all of the store, see
 * store.h. */
#ifndef UNBAKE_STORE_OUTPUTS_H
#define UNBAKE_STORE_OUTPUTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"

struct store; /* store.h */

/* Identifies a version of a file by fields of its stat. */
struct file_version {
    uint64_t inode, bytes;
    int64_t modified_ns, changed_ns; /* Unix time */
};

struct output_row {
    char *name;
    uint64_t bytes;
    char sha256[65]; /* as reported by the worker */
    char *content_type;
    int64_t updated_ms;
    int attempt;
    char digest[65]; /* as computed by the daemon ("": not yet) from this version of the file: */
    struct file_version version;
};
void output_row_release(struct output_row *row);
/* Letters, digits, '_', '-', '.', and '/' between parts that do not begin with a dot; at most 200 bytes. */
bool store_output_is_name(const char *name);
/* Records a complete file of the job's out/ folder and appends its event (`type` is EVENT_OUTPUT or EVENT_PREVIEW).
 * STATUS_INPUT when the name is not a plain relative path. Requests its digest. */
enum status store_output_put(struct store *store, int64_t job_id, int attempt, const char *type, const char *name,
                             uint64_t bytes, const char *sha256, const char *content_type, struct error *err);
enum status store_output_get(struct store *store, int64_t job_id, const char *name, struct output_row *row,
                             struct error *err);
/* `wanted` is called, outside the store's mutex, when a digest has been requested. One subscriber; set before threads
 * start. */
void store_on_digest_wanted(struct store *store, void (*wanted)(void *user), void *user);
/* Requests the digest of the output's current version. */
enum status store_output_want_digest(struct store *store, int64_t job_id, const char *name, struct error *err);
/* The smallest output with a requested digest; STATUS_NOT_FOUND when there is none. */
enum status store_output_next_digest(struct store *store, int64_t *job_id, struct output_row *row, struct error *err);
/* Enters the digest of a version of the file that `row` announced; NULL: it cannot be computed. Nothing changes where
 * the output was announced again, or is gone. */
enum status store_output_enter_digest(struct store *store, int64_t job_id, const struct output_row *row,
                                      const struct file_version *version, const char *digest, struct error *err);
/* All outputs, ordered by name; *rows is the caller's: release each, then mem_free. */
enum status store_output_list(struct store *store, int64_t job_id, struct output_row **rows, size_t *count,
                              struct error *err);

#endif
