/* retention.h -- how long scenes, jobs and uploads are kept, and which have expired.
 *
 * 1. A job that has not ended, and a scene that is being checked or that such a job uses, is kept
 *    whatever its times say; what is pinned is kept for good.
 * 2. Otherwise the expiry set for the thing itself applies, else the configuration's period. It starts at the end of a
 *    job, at the last upload or the end of the last job of a scene, and at the last byte of an upload. An upload of
 *    which no byte has arrived expires much earlier, since it reserves all of its space.
 * 3. What is listed as expired may be pinned or used a moment later: store_expired_delete checks again, in the
 *    transaction that deletes.
 *
 * Thread-safe as store.h is. */
#ifndef UNBAKE_STORE_RETENTION_H
#define UNBAKE_STORE_RETENTION_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"

struct store;

/* The periods of rule 2; 0: no limit (not for uploads). Call once, before anything is listed. */
enum status store_retention_set_periods(struct store *store, int64_t scene_ms, int64_t job_ms, int64_t upload_ms,
                                        struct error *err);

/* The same for an upload of which no byte has arrived. */
enum status store_retention_set_empty_upload(struct store *store, int64_t upload_ms, struct error *err);

enum keep_pin { KEEP_PIN_AS_IS, KEEP_PIN_ON, KEEP_PIN_OFF };
/* A change for one thing; all zeros change nothing. */
struct retention {
    enum keep_pin pin;
    bool sets_expiry;
    int64_t expires_ms; /* with sets_expiry: Unix time; 0: by the configuration */
};

enum expired_kind { EXPIRED_UPLOAD, EXPIRED_JOB, EXPIRED_SCENE };

struct expired {
    enum expired_kind kind;
    char id[65]; /* a job's number is in decimal */
    char *name;
    int64_t expires_ms;
};
/* What has expired by `now_ms`: uploads first, then jobs, then scenes; at most `limit`. The caller's: mem_free each
 * name, then the list. */
enum status store_expired_list(struct store *store, int64_t now_ms, size_t limit, struct expired **list, size_t *count,
                               struct error *err);
/* Removes the rows; STATUS_CONFLICT where it must be kept after all. The caller removes the files. */
enum status store_expired_delete(struct store *store, const struct expired *what, int64_t now_ms, struct error *err);

#endif
