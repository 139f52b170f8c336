/* picture_record.h -- what a render's attempts have recorded of the pictures that they have done: out/views.jsonl of
 * each, to which a line of JSON is appended when a picture's files have their final names (relight/output.h, which
 * judges by digests what is whole):
 *
 *   {"picture":17,"digest":"…","files":[{"name":"00017_radiance.exr","bytes":…,"sha256":"…"},…],…}
 *
 * A worker has written them after it has parsed untrusted files: no member is taken for granted. */
#ifndef UNBAKE_DATA_PICTURE_RECORD_H
#define UNBAKE_DATA_PICTURE_RECORD_H

#include <stddef.h>
#include <stdint.h>

#include "common/error.h"

/* How many of the `count` pictures from `first` on are done one after another, by records with that digest whose files
 * are there in their size. `numbers`: [number_count] attempts of the job that may have recorded them. */
enum status picture_record_done(const char *data_dir, int64_t job_id, const int *numbers, size_t number_count,
                                const char *digest, int64_t first, int64_t count, int64_t *done, struct error *err);

/* Appends what the record `from` has to the record `to`, durably, and removes `from`; nothing is done where it is not
 * there. After a crash lines may be there twice. */
enum status picture_record_move(const char *from, const char *to, struct error *err);

#endif
