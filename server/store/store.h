/* store.h -- state.db: scenes, jobs, events, outputs. The daemon's memory.
 *
 * 1. One process, one connection, one mutex around it: SQLite before 3.51.3 can lose
 *    acknowledged writes when two connections' checkpoint and commit overlap. The connection
 *    holds an exclusive lock on the file, so a second one is refused, whoever opens it.
 * 2. Every function is one transaction: when it returns STATUS_OK the change is on disk.
 * 3. A transition checks the state it starts from and answers STATUS_CONFLICT, with a sentence,
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
#include "server/store/retention.h"
#include "server/store/users.h"

struct store; /* opaque */

/* Opens or creates DIR/state.db, migrates its schema forward (a newer one is refused), checks
 * it. The caller holds the data folder's lock. */
enum status store_open(struct store **store, const char *dir, struct error *err);
void store_close(struct store *store);
const char *store_library_version(void); /* SQLite's */
/* Writes and reads back a row: what /readyz asks. */
enum status store_probe(struct store *store, struct error *err);

/* Whether files that go by that id belong to a row; true in doubt, lest they be removed. Cheap: at
 * start every folder is asked about. */
enum store_files { STORE_FILES_SCENE, STORE_FILES_JOB, STORE_FILES_UPLOAD /* not yet a scene */ };
bool store_has_files(struct store *store, enum store_files kind, const char *id);

/* Writes a consistent copy to the empty file `path` while others go on using the store. */
enum status store_backup(struct store *store, const char *path, struct error *err);

/* DATA/reserve is a file of nothing that is given up where what frees space or stops work cannot be entered. Makes it
 * anew where there is room for it. */
void store_reserve_renew(struct store *store);

/* Called, outside the store's mutex, after a transaction that appended events to `job_id` (0: a
 * scene changed). One subscriber; set before threads start. */
void store_on_change(struct store *store, void (*changed)(void *user, int64_t job_id), void *user);

/* How many of a thing there may be, and of one user's (0: no limit; of nobody's there is none). Where a user
 * asks for one more: STATUS_LIMIT. */
struct count_limits {
    size_t all, one_user;
};

/* --- scenes ------------------------------------------------------------------------------ */

struct scene_row {
    char id[SCENE_ID_SIZE];
    char *name;  /* as its owner below calls it; the beginning of the id where there is none */
    char *owner; /* whoever asks, if he has sent it; else who shares it with him; for who sees all, the first
                             * who sent it. "" for nobody */
    enum scene_state state;
    uint64_t bytes;     /* of the archive */
    int64_t disk_bytes; /* that its folder takes; -1: not known */
    int64_t created_ms; /* when that owner sent it */
    char *problems;     /* JSON array text: [{"file","reason"}]; "[]" if none */
    char *facts;        /* JSON object text: what the check found; "{}" before */
    char *reading;      /* JSON object text: how it is to be read, as was given (common/reading.h) */
    bool is_pinned;
    int64_t expires_ms; /* Unix time as of now, 0: never; see retention.h */
};
void scene_row_release(struct scene_row *row);

/* A complete, durable upload by user owner_id: the row starts in `checking`. Content that is there
 * already is no error: the user owns it too, by that name (one who did keeps his, and *existed is set: that others do is
 * not his to know), and nothing else changes, but one that was rejected or waits for room is checked again. */
enum status store_scene_add(struct store *store, const char *id, const char *name, uint64_t bytes, int64_t owner_id,
                            bool *existed, struct error *err);
/* The end of a check, which read the scene as `reading` says (NULL: as it is to be read now). Where it is to be read
 * otherwise by now, nothing is entered: it stays in `checking` and is checked again. What a ready one takes of the disk
 * was entered before; of a rejected one, `facts` may have warnings. */
enum status store_scene_ready(struct store *store, const char *id, const char *reading, const char *facts,
                              struct error *err);
enum status store_scene_reject(struct store *store, const char *id, const char *reading, const char *problems,
                               const char *facts, struct error *err);
/* As who sees all and owns nothing. */
enum status store_scene_get(struct store *store, const char *id, struct scene_row *row, struct error *err);
/* The row whose id is or begins with `prefix` (4 to 64 hex digits) among those that `who` (NULL: all)
 * may read; STATUS_CONFLICT when several do. */
enum status store_scene_find(struct store *store, const struct caller *who, const char *prefix, struct scene_row *row,
                             struct error *err);
/* What `who` (NULL: all) may read, newest first, before (created_ms, id) of a cursor ("" for the
 * first page). rows[limit] out. */
enum status store_scene_list(struct store *store, const struct caller *who, const char *cursor, size_t limit,
                             struct scene_row *rows, size_t *count, char next_cursor[128], struct error *err);
struct scene_patch {
    const char *name; /* NULL leaves it; changed for the owner that `who` sees */
    struct retention retention;
    const char *reading; /* JSON object text; NULL leaves it */
};
/* A new reading puts the scene back into `checking`, also where it is the same and the check has ended. STATUS_CONFLICT
 * when others own it, too, and could lose it by this, or have jobs on it that have not ended and would read it otherwise;
 * not for an admin. And for anybody while a job that has begun with it has not ended. */
enum status store_scene_patch(struct store *store, const struct caller *who, const char *id,
                              const struct scene_patch *patch, struct error *err);
/* The same for a reading that comes with an upload: one that the scene has already changes nothing. */
enum status store_scene_give_reading(struct store *store, const struct caller *who, const char *id, const char *reading,
                                     struct error *err);
/* Ends the ownership of user owner_id (-1: everybody's); where nobody owns it any more, the scene
 * goes: *is_gone, and the caller removes the files. STATUS_CONFLICT while it is being checked or a
 * job that is not terminal (of that owner, where others stay) uses it. Terminal jobs keep its id. A
 * dry run changes nothing. */
enum status store_scene_delete(struct store *store, const char *id, int64_t owner_id, bool dry_run, bool *is_gone,
                               struct error *err);
/* Scenes in `checking` that do not wait for room: of each user the oldest, except those of skip[skip_count].
 * list[limit] out, the oldest first. A scene of several users is here the first one's. */
struct unchecked {
    char id[SCENE_ID_SIZE];
    int64_t owner_id; /* 0: nobody */
};
enum status store_scene_unchecked(struct store *store, const struct unchecked *skip, size_t skip_count, size_t limit,
                                  struct unchecked *list, size_t *count, struct error *err);
/* A check that found too little room, as `problems` says: the scene stays in `checking`, can be removed
 * while it waits, and is no next one before store_scene_check_again, which makes all of them so. */
enum status store_scene_postpone(struct store *store, const char *id, const char *reading, const char *problems,
                                 struct error *err);
enum status store_scene_check_again(struct store *store, struct error *err);

/* --- jobs -------------------------------------------------------------------------------- */

struct job_new {
    const char *scene_id, *name, *labels, *settings;
    int64_t owner_id; /* 0: nobody */
    bool is_shared;
    int priority, max_attempts;
    size_t user_queue_limit;                  /* queued jobs of its owner; 0: no limit */
    size_t user_max_jobs;                     /* all jobs of its owner; 0: no limit */
    const char *webhook_url, *webhook_secret; /* NULL: none */
    const char *idempotency_key;              /* NULL: none */
    const char *request_sha256;               /* of the request, compared when the key is known */
};
/* queue_limit: STATUS_LIMIT when that many jobs are queued, by all or by its owner (who is somebody);
 * STATUS_NO_SPACE when its owner keeps as many as may be. With a known key: the earlier job's id and *replayed; STATUS_CONFLICT when the request differs. The scene may still be in
 * `checking`; STATUS_CONFLICT when it is rejected, STATUS_NOT_FOUND when there is none. */
enum status store_job_add(struct store *store, const struct job_new *job, size_t queue_limit, int64_t *id,
                          bool *replayed, struct error *err);
enum status store_job_get(struct store *store, int64_t id, struct job *job, struct error *err);
/* What `who` (NULL: all) may read, newest first; state_filter < 0: all; before_id 0: from the
 * newest. jobs[limit] out. */
enum status store_job_list(struct store *store, const struct caller *who, int state_filter, int64_t before_id,
                           size_t limit, struct job *jobs, size_t *count, struct error *err);
enum job_place { JOB_PLACE_KEEP, JOB_PLACE_FIRST, JOB_PLACE_LAST, JOB_PLACE_BEFORE };
struct job_patch {
    const char *name, *labels; /* NULL: as it is */
    int priority;              /* INT_MIN: as it is */
    int shared;                /* 0, 1; -1: as it is */
    enum job_place place;      /* among the jobs of its priority */
    struct retention retention;
    int64_t before_id; /* with JOB_PLACE_BEFORE, which takes over that job's priority */
};
/* expected_revision -1: any; else STATUS_CONFLICT if it differs. STATUS_INPUT when the job to go
 * before does not wait. */
enum status store_job_patch(struct store *store, int64_t id, int64_t expected_revision, const struct job_patch *patch,
                            struct error *err);
enum status store_job_delete(struct store *store, int64_t id, struct error *err); /* not running */
/* The queued job whose turn it is, among those whose scene has been checked (ready, or rejected:
 * such a job is started only to fail); STATUS_NOT_FOUND if none. Of the users that have fewer than
 * user_max_running jobs running (0: no limit), the one with the least recent CPU time; of that
 * user's jobs the one of highest priority, then the first in turn. */
enum status store_job_next(struct store *store, int user_max_running, int64_t *id, struct error *err);
/* Charges CPU time to a user. Where that fails it is kept in memory; store_usage_pay, and the next charge of anybody,
 * enters it. */
enum status store_usage_add(struct store *store, int64_t owner_id, double cpu_sec, struct error *err);
enum status store_usage_pay(struct store *store, struct error *err);
/* Running jobs and what is requested of them, for the scheduler. ids[limit], wanted[limit] out. */
enum status store_job_running(struct store *store, size_t limit, int64_t *ids, enum job_wanted *wanted, size_t *count,
                              struct error *err);

/* What users ask. A running job only gets the request recorded; the scheduler fulfils it (wake it).
 * Asking again for what is so already is STATUS_OK and changes nothing. Resume takes back a request
 * to pause. Retry is for failed and cancelled jobs; with `from`, a stage that job_stage_parse
 * knows (else NULL), also for succeeded ones. Extend gives a job that has ended new settings.
 * Those that put a job into the queue keep `limits` (NULL: none). */
enum status store_job_cancel(struct store *store, int64_t id, struct error *err);
enum status store_job_pause(struct store *store, int64_t id, struct error *err);
enum status store_job_resume(struct store *store, int64_t id, const struct count_limits *limits, struct error *err);
enum status store_job_retry(struct store *store, int64_t id, int max_attempts, const char *from,
                            const struct count_limits *limits, struct error *err);
enum status store_job_extend(struct store *store, int64_t id, int max_attempts, const char *settings,
                             const struct count_limits *limits, struct error *err);

/* What the scheduler does. A job whose scene is being checked does not start; `attempt` fences: STATUS_CONFLICT when another one is present. A request
 * to cancel, recorded before, wins over every end; one to pause over going back to the queue. */
enum status store_job_start(struct store *store, int64_t id, int *attempt, struct error *err);
enum status store_job_succeed(struct store *store, int64_t id, int attempt, struct error *err);
/* The same, with what a user should know of it: what a time limit left out. */
enum status store_job_succeed_but(struct store *store, int64_t id, int attempt, const char *reason, struct error *err);
/* The input is at fault: trying again will not help. */
enum status store_job_fail(struct store *store, int64_t id, int attempt, const char *reason, const char *hint,
                           struct error *err);
/* The job's restart_from was seen to. */
enum status store_job_restarted(struct store *store, int64_t id, int attempt, struct error *err);
/* The attempt crashed: back to the queue, or failed when it was the last one. memory_step is what
 * the next attempt gets. */
enum status store_job_crash(struct store *store, int64_t id, int attempt, const char *reason, const char *hint,
                            int memory_step, struct error *err);
/* The attempt was stopped by us (a request, shutdown): back to the queue, or as was requested. */
enum status store_job_stop(struct store *store, int64_t id, int attempt, const char *reason, struct error *err);
/* The attempt cannot go on until somebody acts (disk full): paused. */
enum status store_job_block(struct store *store, int64_t id, int attempt, const char *reason, const char *hint,
                            struct error *err);
/* Gives every queued job that reason, where it has another one; where `reason` is "", takes those
 * away that begin with `prefix`. Each change is a state event. */
enum status store_job_explain(struct store *store, const char *reason, const char *prefix, const char *hint,
                              struct error *err);
/* At start: whatever claims to run is queued again (or paused, cancelled, as was requested). It does
 * not count as a failed attempt: the job is not at fault when the daemon or the machine dies. What such a job takes
 * of the disk is not known then. */
enum status store_reconcile(struct store *store, size_t *requeued, struct error *err);

/* --- what users keep --------------------------------------------------------------------- */

/* What a user keeps, but for one scene (NULL) and one job (0): the folders of scenes and jobs as store_disk_enter has
 * them, of a scene at least its archive; of a job that runs at least its outputs; uploads that are under way with
 * their whole length. A scene of several users counts for each of them. */
enum status store_user_bytes(struct store *store, int64_t user_id, const char *but_scene, int64_t but_job,
                             uint64_t *bytes, struct error *err);
/* What is still to come of the user's uploads of which something has arrived (or which were made) since since_ms: older
 * ones hold no space (resumables_maintain). And how many of the user's scenes wait to be checked or are being checked. */
enum status store_user_pledged(struct store *store, int64_t user_id, int64_t since_ms, uint64_t *bytes,
                               struct error *err);
enum status store_user_checks(struct store *store, int64_t user_id, size_t *count, struct error *err);
struct share {
    uint64_t limit_bytes;  /* 0: no limit */
    int64_t user_id;       /* 0: nobody, who has no limit */
    const char *but_scene; /* as above */
    int64_t but_job;
};
/* STATUS_LIMIT, with a sentence for that user, unless he may keep `more` bytes besides what he does. */
enum status store_share_check(struct store *store, const struct share *share, uint64_t more, struct error *err);
/* The same for a scene that takes `bytes` in all: unless one of its owners may keep it. */
enum status store_share_check_scene(struct store *store, const char *id, uint64_t bytes, uint64_t limit_bytes,
                                    struct error *err);

/* What the folder of a job or (job_id 0) a scene takes of the disk. */
struct disk_use {
    int64_t job_id;
    char scene_id[SCENE_ID_SIZE];
    int64_t bytes; /* -1: not known */
};
/* Enters it; what is gone is skipped. */
enum status store_disk_enter(struct store *store, const struct disk_use *list, size_t count, struct error *err);
/* Those of which it is not known, ready scenes first, but for the first `skip`. list[limit] out. */
enum status store_disk_unknown(struct store *store, size_t skip, size_t limit, struct disk_use *list, size_t *count,
                               struct error *err);

/* --- events, outputs --------------------------------------------------------------------- */

/* `type` and `data` (JSON object text) as in common/protocol.h. STATUS_CONFLICT when `attempt`
 * is not the present one. A progress event also updates the job's row (its members stage, done,
 * total, eta_sec) and replaces the job's progress event before it, so that a long run does not
 * fill the disk. */
enum status store_event_add(struct store *store, int64_t job_id, int attempt, const char *type, const char *data,
                            struct error *err);
/* Events of a job with id > after, oldest first, at most `limit`, through `each`, which is called
 * with the store locked: it copies what it needs and must not call the store. */
enum status store_event_list(struct store *store, int64_t job_id, int64_t after, size_t limit,
                             void (*each)(void *user, int64_t id, int64_t at_ms, int attempt, const char *type,
                                          const char *data),
                             void *user, struct error *err);
/* The next part of a stream: events with id > after of a job, or (job_id 0) of all jobs that `who`
 * (NULL: everybody) may read, until `limit` events or byte_limit bytes of data have come; `each` as
 * above. STATUS_NOT_FOUND when there is no such job for `who`. */
struct event_row {
    int64_t id, job_id, at_ms;
    int attempt;
    const char *type, *data;
};
struct event_page {
    size_t count;
    bool is_full;         /* there may be more */
    int64_t last_id;      /* where the next part begins */
    int64_t pruned_id;    /* events up to here may be gone, besides overtaken progress */
    enum job_state state; /* of the job, before its events were looked at */
    int64_t revision, owner_id;
    bool is_shared;
};
enum status store_event_page(struct store *store, const struct caller *who, int64_t job_id, int64_t after, size_t limit,
                             size_t byte_limit, void (*each)(void *user, const struct event_row *row), void *user,
                             struct event_page *page, struct error *err);
/* Of each job the newest `per_job` events are kept, about; before threads start. */
void store_keep_events(struct store *store, size_t per_job);
/* Removes all but the last event of one job that ended before that time; *more: there was one. */
enum status store_event_prune(struct store *store, int64_t before_ms, bool *more, struct error *err);
/* The id of the newest event of the job, or (0) of all; 0 when there is none: where a stream without
 * history begins. */
enum status store_event_last(struct store *store, int64_t job_id, int64_t *id, struct error *err);
/* The largest id that an event of this database ever had, also of one that is gone. */
enum status store_event_newest(struct store *store, int64_t *id, struct error *err);

/* A message for a webhook, made by every change of its job's state. */
struct outbox_row {
    int64_t id, job_id;
    int64_t owner_id;          /* whose job it is; 0: nobody's */
    char *url, *secret, *body; /* owned */
    int tries;
};
void outbox_row_release(struct outbox_row *row);
/* The first message with id > after whose time has come, of users that are none of skip[skip_count]; STATUS_NOT_FOUND
 * when there is none. */
enum status store_outbox_next(struct store *store, int64_t after, const int64_t *skip, size_t skip_count,
                              struct outbox_row *row, struct error *err);
/* How long until the next message's time comes, of those whose time has not come yet; infinite when
 * there is none. */
enum status store_outbox_wait(struct store *store, double *seconds, struct error *err);
struct outbox_outcome {
    bool delivered;
    bool is_final;      /* another try would end like this one */
    int status;         /* that was answered; 0: none */
    const char *reason; /* why it was not delivered; NULL: it was */
};
/* Removes a message that was delivered, or puts it off: longer each time, and in the end for ever. The job shows it. */
enum status store_outbox_settle(struct store *store, int64_t id, const struct outbox_outcome *outcome, bool *gave_up,
                                struct error *err);
/* The job's messages that wait are sent now, with all their tries before them; where there are none, one of its present
 * state. STATUS_CONFLICT: the job has no webhook. */
enum status store_webhook_again(struct store *store, int64_t job_id, struct error *err);

/* What tells one version of a file from another, as stat has it. */
struct file_version {
    uint64_t inode, bytes;
    int64_t modified_ns, changed_ns; /* Unix time */
};

struct output_row {
    char *name;
    uint64_t bytes;
    char sha256[65]; /* as the worker says */
    char *content_type;
    int64_t updated_ms;
    int attempt;
    char digest[65]; /* as the daemon found it ("": not yet), in this version of the file: */
    struct file_version version;
};
void output_row_release(struct output_row *row);
/* Records a complete file of the job's out/ folder and appends its event (`type` is
 * EVENT_OUTPUT or EVENT_PREVIEW). STATUS_INPUT when the name is not a plain relative path. Its digest is
 * wanted from then on. */
enum status store_output_put(struct store *store, int64_t job_id, int attempt, const char *type, const char *name,
                             uint64_t bytes, const char *sha256, const char *content_type, struct error *err);
enum status store_output_get(struct store *store, int64_t job_id, const char *name, struct output_row *row,
                             struct error *err);
/* Called, outside the store's mutex, when a digest has become wanted. One subscriber; set before threads start. */
void store_on_digest_wanted(struct store *store, void (*wanted)(void *user), void *user);
/* The digest of what the output is now is wanted, if it was not. */
enum status store_output_want_digest(struct store *store, int64_t job_id, const char *name, struct error *err);
/* The smallest output whose digest is wanted; STATUS_NOT_FOUND when there is none. */
enum status store_output_next_digest(struct store *store, int64_t *job_id, struct output_row *row, struct error *err);
/* The digest of that version of the file that `row` announced; NULL: there will be none. Nothing changes where the
 * output was announced again, or is gone. */
enum status store_output_enter_digest(struct store *store, int64_t job_id, const struct output_row *row,
                                      const struct file_version *version, const char *digest, struct error *err);
/* All outputs by name; rows is allocated, the caller's: release each, then mem_free. */
enum status store_output_list(struct store *store, int64_t job_id, struct output_row **rows, size_t *count,
                              struct error *err);

/* --- uploads in parts ---------------------------------------------------------------------- */

#define UPLOAD_ID_SIZE 33   /* 32 hex digits and the NUL */
#define UPLOAD_BOOT_SIZE 40 /* as boot.h has it */

struct upload_row {
    char id[UPLOAD_ID_SIZE];
    int64_t owner_id;
    char *owner;                  /* a user's name; "" for nobody */
    char *name;                   /* for the scene */
    char *metadata;               /* as the client gave it: Upload-Metadata */
    char *reading;                /* for the scene, as scene_row has it; "" or NULL: not said */
    char sha256[SCENE_ID_SIZE];   /* what the client says the whole will have; "" if it does not */
    uint64_t length, received;    /* bytes; `received` are on disk */
    char boot[UPLOAD_BOOT_SIZE];  /* see store_upload_begin */
    char scene_id[SCENE_ID_SIZE]; /* what became of it, once all is received; "" before */
    bool is_pinned;
    int64_t created_ms, updated_ms, expires_ms; /* expires_ms 0: never */
};
void upload_row_release(struct upload_row *row);

/* A new row with nothing received; id, owner_id, name, metadata, reading, sha256, length and boot are taken from *row.
 * `hash`: the state of an empty hash. The limits are those of unfinished ones. */
enum status store_upload_add(struct store *store, const struct upload_row *row, const void *hash, size_t hash_size,
                             const struct count_limits *limits, struct error *err);
/* hash (may be NULL) gets the kept state; STATUS_CORRUPT when it has another size. */
enum status store_upload_get(struct store *store, const char *id, struct upload_row *row, void *hash, size_t hash_size,
                             struct error *err);
/* Those of `who` (NULL or an admin: all), newest first; sha256 "" for all; cursor as in
 * store_scene_list. */
enum status store_upload_list(struct store *store, const struct caller *who, const char *sha256, const char *cursor,
                              size_t limit, struct upload_row *rows, size_t *count, char next_cursor[128],
                              struct error *err);
/* The file may now hold bytes beyond `received` that are good while the machine runs on (`boot` is
 * its boot id), or that are not to be counted ("" ). */
enum status store_upload_begin(struct store *store, const char *id, const char *boot, struct error *err);
/* So many bytes are on disk, with the state of their hash. Never goes back: less than is known is
 * no error and changes nothing. */
enum status store_upload_advance(struct store *store, const char *id, uint64_t received, const void *hash,
                                 size_t hash_size, struct error *err);
enum status store_upload_finish(struct store *store, const char *id, const char *scene_id, struct error *err);
enum status store_upload_keep(struct store *store, const char *id, const struct retention *retention,
                              struct error *err);
enum status store_upload_delete(struct store *store, const char *id, struct error *err);

/* --- counts ------------------------------------------------------------------------------ */

struct store_counts {
    int64_t jobs_by_state[JOB_STATE_COUNT], scenes_by_state[SCENE_STATE_COUNT];
    int64_t attempts, events;
    int64_t outbox;           /* messages of webhooks that are still to be delivered */
    int64_t oldest_queued_ms; /* when the oldest job that waits was made; 0: none does */
    uint64_t wal_bytes;
};
enum status store_count(struct store *store, struct store_counts *counts, struct error *err);

#endif
