/* store.h -- state.db: scenes, jobs, events, and what the headers that it includes are about.
 *
 * 1. One process, one connection, one mutex around it: SQLite before 3.51.3 can lose
 *    acknowledged writes when two connections' checkpoint and commit overlap. The connection
 *    holds an exclusive lock on the file, so a second one is refused, whoever opens it.
 * 2. Every function is one transaction: when it returns STATUS_OK the change is on disk.
 * 3. A transition checks the state it starts from and returns STATUS_CONFLICT, with a message,
 *    when that forbids it; unknown ids are STATUS_NOT_FOUND.
 * 4. A transition appends its `state` event in the same transaction.
 * 5. Event ids grow over all jobs and are never used twice.
 * 6. What frees space or stops work (cancel, pause, delete, the end of an attempt, the end of a token) needs none: it
 *    works on a full disk; see reserve.c. All else is STATUS_NO_SPACE there.
 * 7. A list of scenes, jobs, outputs or uploads that cannot be read to its end has no rows.
 *
 * All functions are thread-safe. */
#ifndef UNBAKE_STORE_STORE_H
#define UNBAKE_STORE_STORE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/buf.h"
#include "common/error.h"
#include "server/job/job.h"
#include "server/store/attempts.h"
#include "server/store/limits.h"
#include "server/store/outbox.h"
#include "server/store/outputs.h"
#include "server/store/parts.h"
#include "server/store/retention.h"
#include "server/store/uploads.h"
#include "server/store/usage.h"
#include "server/store/users.h"

struct store; /* opaque */

/* Opens or creates DIR/state.db, migrates its schema forward (a newer one is refused), checks it. The caller holds
 * the data folder's lock. */
enum status store_open(struct store **store, const char *dir, struct error *err);
void store_close(struct store *store);
const char *store_library_version(void); /* SQLite's */
/* Writes a row and reads it back; for /readyz. */
enum status store_probe(struct store *store, struct error *err);

/* Whether files with that id belong to a row; true when in doubt, because others are removed. Cheap: at start it is
 * called for every folder. */
enum store_files { STORE_FILES_SCENE, STORE_FILES_JOB, STORE_FILES_UPLOAD /* not yet a scene */ };
bool store_has_files(struct store *store, enum store_files kind, const char *id);

/* Writes a consistent copy to the empty file `path`; other calls proceed meanwhile. */
enum status store_backup(struct store *store, const char *path, struct error *err);

/* Recreates DATA/reserve where there is space. The file is given up when a transaction that frees space or stops work
 * fails on a full disk. */
void store_reserve_renew(struct store *store);

/* `changed` is called, outside the store's mutex, after a transaction that appended events to `job_id` (0: a scene
 * changed). One subscriber; set before threads start. */
void store_on_change(struct store *store, void (*changed)(void *user, int64_t job_id), void *user);

/* --- scenes ------------------------------------------------------------------------------ */

struct scene_row {
    char id[SCENE_ID_SIZE];
    char *name;  /* the name that `owner` gave it; without one, the beginning of the id */
    char *owner; /* the caller if he uploaded it, else who shares it with him, for admins who uploaded it first; "":
                  * nobody */
    enum scene_state state;
    uint64_t bytes;     /* size of the archive */
    int64_t disk_bytes; /* size of its folder; -1: unknown */
    int64_t created_ms; /* when `owner` uploaded it */
    char *problems;     /* JSON array text: [{"file","reason"}]; "[]" if none */
    char *facts;        /* JSON object text: the result of the check; "{}" before */
    char *reading;      /* JSON object text: how its files are read, as submitted (common/reading.h) */
    bool is_pinned;
    int64_t expires_ms; /* Unix time as of now, 0: never; see retention.h */
};
void scene_row_release(struct scene_row *row);

/* Adds a complete, durable upload by user owner_id; the row starts in `checking`. If the content exists already, the
 * user becomes an owner of it under that name; one who owned it keeps his name, and *existed is set (it stays clear
 * where only others own it: that is not his to know). A scene that was rejected or waits for disk space is then
 * checked again. */
enum status store_scene_add(struct store *store, const char *id, const char *name, uint64_t bytes, int64_t owner_id,
                            bool *existed, struct error *err);
/* Ends a check that used `reading` (NULL: the current one). If the scene's reading has changed since, nothing is
 * entered: the scene stays in `checking` and is checked again. The disk usage of a ready scene must have been entered;
 * `facts` of a rejected one may hold warnings. */
enum status store_scene_ready(struct store *store, const char *id, const char *reading, const char *facts,
                              struct error *err);
/* Facts known by now of a scene that is being checked, by the same rule; of any other nothing is entered. */
enum status store_scene_set_facts(struct store *store, const char *id, const char *reading, const char *facts,
                                  struct error *err);
enum status store_scene_reject(struct store *store, const char *id, const char *reading, const char *problems,
                               const char *facts, struct error *err);
/* As seen by a caller who may read everything and owns nothing. */
enum status store_scene_get(struct store *store, const char *id, struct scene_row *row, struct error *err);
/* Finds the scene whose id starts with `prefix` (4 to 64 hex digits) among those that `who` (NULL: all) may read;
 * STATUS_CONFLICT when there are several. */
enum status store_scene_find(struct store *store, const struct caller *who, const char *prefix, struct scene_row *row,
                             struct error *err);
/* Scenes that `who` (NULL: all) may read, newest first, from the cursor on ("": the first
 * page). Fills rows[limit]. */
enum status store_scene_list(struct store *store, const struct caller *who, const char *cursor, size_t limit,
                             struct scene_row *rows, size_t *count, char next_cursor[128], struct error *err);
struct scene_patch {
    const char *name; /* of the owner that `who` sees; NULL: unchanged */
    struct retention retention;
    const char *reading; /* JSON object text; NULL: unchanged */
};
/* A reading, even an unchanged one after the check has ended, puts the scene back into `checking`. STATUS_CONFLICT when
 * other owners could lose the scene by the change, or have unfinished jobs that would read it differently (not for an
 * admin); and for everybody while a job that has started on it has not ended. */
enum status store_scene_patch(struct store *store, const struct caller *who, const char *id,
                              const struct scene_patch *patch, struct error *err);
/* The same for a reading that comes with an upload; an unchanged one has no effect. */
enum status store_scene_give_reading(struct store *store, const struct caller *who, const char *id, const char *reading,
                                     struct error *err);
/* Ends the ownership of user owner_id (-1: of all). Without owners the scene is deleted: *is_gone is set, and the
 * caller removes the files. STATUS_CONFLICT while it is being checked or a job that has not ended (of that owner,
 * where others stay) uses it. Ended jobs keep its id. A dry run changes nothing. */
enum status store_scene_delete(struct store *store, const char *id, int64_t owner_id, bool dry_run, bool *is_gone,
                               struct error *err);
/* Scenes in `checking` that are not waiting for disk space: the oldest of each user, except skip[skip_count]. Fills
 * list[limit], oldest first. A scene of several users counts for its first. */
struct unchecked {
    char id[SCENE_ID_SIZE];
    int64_t owner_id; /* 0: nobody */
};
enum status store_scene_unchecked(struct store *store, const struct unchecked *skip, size_t skip_count, size_t limit,
                                  struct unchecked *list, size_t *count, struct error *err);
/* The check found too little disk space, as `problems` says. The scene stays in `checking` and can be deleted; it is
 * not checked again until store_scene_check_again, which applies to all such scenes. */
enum status store_scene_postpone(struct store *store, const char *id, const char *reading, const char *problems,
                                 struct error *err);
enum status store_scene_check_again(struct store *store, struct error *err);

/* --- jobs -------------------------------------------------------------------------------- */

struct job_new {
    enum job_kind kind;
    int64_t source_id;       /* whose outputs it reads; 0 for a reconstruction */
    double cost;             /* as in struct job */
    const char *const *file; /* [file_count] names of files that come later (job_files.h) */
    size_t file_count;
    const char *scene_id, *name, *labels, *settings;
    int64_t owner_id; /* 0: nobody */
    bool is_shared;
    int priority, max_attempts;
    size_t user_queue_limit;                  /* queued jobs of the owner; 0: no limit */
    size_t user_max_jobs;                     /* all jobs of the owner; 0: no limit */
    const char *webhook_url, *webhook_secret; /* NULL: none */
    const char *idempotency_key;              /* NULL: none */
    const char *request_sha256;               /* of the request; must be the same where the key is known */
};
/* queue_limit and job->user_queue_limit: STATUS_LIMIT when that many jobs are queued, in all or of the owner.
 * STATUS_NO_SPACE when the owner has user_max_jobs jobs. With a known key: the earlier job's id, and *replayed;
 * STATUS_CONFLICT when the request differs. The scene may still be in `checking`; STATUS_CONFLICT when it is
 * rejected, STATUS_NOT_FOUND when there is none; a render needs none. STATUS_CONFLICT when the source has no
 * results. */
enum status store_job_add(struct store *store, const struct job_new *job, size_t queue_limit, int64_t *id,
                          bool *replayed, struct error *err);
enum status store_job_get(struct store *store, int64_t id, struct job *job, struct error *err);
/* Whether another job may read the outputs of this one: STATUS_CONFLICT unless it is a reconstruction that has
 * succeeded. As long as that other job has not ended, it cannot be deleted, retried or extended, nor does it expire. */
enum status store_source_check_readable(struct store *store, int64_t id, struct error *err);
/* STATUS_CONFLICT while a job that has not ended reads the outputs of this one, which cannot be `action` therefore. */
enum status store_source_check_unread(struct store *store, int64_t id, const char *action, struct error *err);
struct job_filter {
    int state, kind;   /* -1: all */
    int64_t source_id; /* 0: all */
    const char *label; /* only jobs that have it; NULL: all */
    const char *value; /* and this value of it; NULL: any */
};
/* Jobs that `who` (NULL: all) may read, newest first; filter NULL: all; before_id 0: from the newest. Fills
 * jobs[limit]. */
enum status store_job_list(struct store *store, const struct caller *who, const struct job_filter *filter,
                           int64_t before_id, size_t limit, struct job *jobs, size_t *count, struct error *err);
enum job_place { JOB_PLACE_KEEP, JOB_PLACE_FIRST, JOB_PLACE_LAST, JOB_PLACE_BEFORE };
struct job_patch {
    const char *name, *labels; /* NULL: unchanged */
    int priority;              /* INT_MIN: unchanged */
    int shared;                /* 0 or 1; -1: unchanged */
    enum job_place place;      /* among the jobs of its priority */
    struct retention retention;
    int64_t before_id; /* for JOB_PLACE_BEFORE; the job also takes that job's priority */
};
/* expected_revision -1: any; else STATUS_CONFLICT if it differs. STATUS_INPUT when the job before_id is not queued. */
enum status store_job_patch(struct store *store, int64_t id, int64_t expected_revision, const struct job_patch *patch,
                            struct error *err);
/* Not a running one, nor one whose outputs another reads. */
enum status store_job_delete(struct store *store, int64_t id, struct error *err);
/* Users' requests. For a running job the request is only recorded; the scheduler fulfils it (wake it). A request for
 * the state that the job already has is STATUS_OK and changes nothing. Resume withdraws a request to pause. Retry is
 * for failed and cancelled jobs; with `from`, a stage that job_stage_parse knows (else NULL), also for succeeded
 * ones. Extend gives new settings to a job that has ended. What queues a job is subject to `limits` (NULL: none). */
enum status store_job_cancel(struct store *store, int64_t id, struct error *err);
enum status store_job_pause(struct store *store, int64_t id, struct error *err);
enum status store_job_resume(struct store *store, int64_t id, const struct count_limits *limits, struct error *err);
enum status store_job_retry(struct store *store, int64_t id, int max_attempts, const char *from,
                            const struct count_limits *limits, struct error *err);
enum status store_job_extend(struct store *store, int64_t id, int max_attempts, const char *settings,
                             const struct count_limits *limits, struct error *err);

/* --- disk usage --------------------------------------------------------------------------- */

/* What a user keeps, without one scene (NULL: none) and one job (0: none): the folders of scenes and jobs as entered
 * by store_disk_enter, at least the archive of a scene and the outputs of a running job; unfinished uploads with
 * their whole length. A scene of several users counts for each of them. */
enum status store_user_bytes(struct store *store, int64_t user_id, const char *but_scene, int64_t but_job,
                             uint64_t *bytes, struct error *err);
/* Bytes still to arrive of the user's uploads that were made or received something since since_ms (older ones reserve
 * no space: resumables_maintain); number of the user's unfinished uploads; number of the user's scenes that are being
 * checked or waiting for it. */
enum status store_user_pledged(struct store *store, int64_t user_id, int64_t since_ms, uint64_t *bytes,
                               struct error *err);
enum status store_user_uploads(struct store *store, int64_t user_id, size_t *count, struct error *err);
enum status store_user_checks(struct store *store, int64_t user_id, size_t *count, struct error *err);
struct share {
    uint64_t limit_bytes;  /* 0: no limit */
    int64_t user_id;       /* 0: nobody, who has no limit */
    const char *but_scene; /* not counted, as above */
    int64_t but_job;
};
/* STATUS_LIMIT, with a message for that user, if he may not keep `more` bytes on top. */
enum status store_share_check(struct store *store, const struct share *share, uint64_t more, struct error *err);
/* The same for a scene of `bytes` in all: STATUS_LIMIT if none of its owners may keep it. */
enum status store_share_check_scene(struct store *store, const char *id, uint64_t bytes, uint64_t limit_bytes,
                                    struct error *err);

/* Size of the folder of a job or (job_id 0) a scene. */
struct disk_use {
    int64_t job_id;
    char scene_id[SCENE_ID_SIZE];
    int64_t bytes; /* -1: unknown */
};
/* Enters sizes; skips what has been deleted. */
enum status store_disk_enter(struct store *store, const struct disk_use *list, size_t count, struct error *err);
/* What has no size yet, ready scenes first, without the first `skip`. Fills list[limit]. */
enum status store_disk_unknown(struct store *store, size_t skip, size_t limit, struct disk_use *list, size_t *count,
                               struct error *err);

/* --- events ----------------------------------------------------------------------------- */

/* Appends an event; `type` and `data` (JSON object text) as in common/protocol.h. STATUS_CONFLICT when `attempt` is
 * not the current one. A progress event also updates the job's row (its members stage, done, total, eta_sec) and
 * replaces the job's previous progress event, so that a long run does not fill the disk. */
enum status store_event_add(struct store *store, int64_t job_id, int attempt, const char *type, const char *data,
                            struct error *err);
/* Calls `each` for at most `limit` events of a job with id > after, oldest first. The store is locked during the
 * call: `each` copies what it needs and must not call the store. */
enum status store_event_list(struct store *store, int64_t job_id, int64_t after, size_t limit,
                             void (*each)(void *user, int64_t id, int64_t at_ms, int attempt, const char *type,
                                          const char *data),
                             void *user, struct error *err);
/* The next events of a stream: those with id > after of a job, or (job_id 0) of all jobs that `who` (NULL: everybody)
 * may read, up to `limit` events or byte_limit bytes of data; `each` as above. STATUS_NOT_FOUND when `who` may read
 * no such job. */
struct event_row {
    int64_t id, job_id, at_ms;
    int attempt;
    const char *type, *data;
};
struct event_page {
    size_t count;
    bool is_full;         /* there may be more */
    int64_t last_id;      /* `after` of the next page */
    int64_t pruned_id;    /* events up to this id may be missing, besides replaced progress */
    enum job_state state; /* of the job, read before its events */
    int64_t revision, owner_id;
    bool is_shared;
};
enum status store_event_page(struct store *store, const struct caller *who, int64_t job_id, int64_t after, size_t limit,
                             size_t byte_limit, void (*each)(void *user, const struct event_row *row), void *user,
                             struct event_page *page, struct error *err);
/* Keeps about the newest `per_job` events of each job. Call before threads start. */
void store_keep_events(struct store *store, size_t per_job);
/* Removes all but the last event of one job that ended before that time; *more: there was one. */
enum status store_event_prune(struct store *store, int64_t before_ms, bool *more, struct error *err);
/* The id of the newest event of the job, or (0) of all; 0 when there is none. A stream without history starts there. */
enum status store_event_last(struct store *store, int64_t job_id, int64_t *id, struct error *err);
/* The largest event id ever used, including removed events. */
enum status store_event_newest(struct store *store, int64_t *id, struct error *err);

/* --- counts ------------------------------------------------------------------------------ */

struct store_counts {
    int64_t jobs_by_state[JOB_STATE_COUNT], scenes_by_state[SCENE_STATE_COUNT];
    int64_t attempts, events;
    int64_t outbox;           /* webhook messages still to be delivered */
    int64_t oldest_queued_ms; /* when the oldest queued job was submitted; 0: none is queued */
    uint64_t wal_bytes;
};
enum status store_count(struct store *store, struct store_counts *counts, struct error *err);

#endif
