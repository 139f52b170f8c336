/* internal.h -- what the store's files share; no other folder includes it. */
#ifndef UNBAKE_STORE_INTERNAL_H
#define UNBAKE_STORE_INTERNAL_H

#include <pthread.h>
#include <stdatomic.h>

#include "server/store/sql.h"

/* What reserve.c knows of the disk space of the database's files. */
struct reserve {
    char *dir;           /* the data folder; owned */
    int wal_fd;          /* -1: not open yet */
    bool is_unsupported; /* the file system cannot preallocate */
    bool is_tight;
    int page_bytes;
    int64_t cushion_bytes; /* bytes kept ahead of the log's end */
    int64_t wal_frames;    /* frames in the log */
    int64_t wal_bytes;     /* bytes allocated for it */
    int64_t page_count;    /* pages allocated for the database file */
    int64_t pages_used;    /* pages in use, including the current transaction */
};

struct buf; /* common/buf.h */

struct store {
    pthread_mutex_t mutex; /* held for every use of sql; recursive */
    struct sql sql;
    struct reserve reserve;
    void (*changed)(void *user, int64_t job_id);
    void *changed_user;
    void (*digest_wanted)(void *user);
    void *digest_wanted_user;
    struct group { /* transactions that are one; transaction.c */
        bool is_open;
        int64_t changed; /* the job that the last of them has changed */
    } group;
    size_t events_per_job; /* kept for each job */
    struct unpaid {        /* CPU time that could not be entered; see turns.c */
        int64_t owner_id;
        char month[8]; /* as in usage.h */
        double weight, cpu_sec;
    } * unpaid; /* [unpaid_count], one a user and month; owned */
    size_t unpaid_count;
    atomic_bool has_users;
    struct remote_table { /* remote.h */
        atomic_ullong changes;
        struct remote_writer {
            int64_t job_id;
            int number;
            size_t count; /* writing at this moment; more than 0 */
        } * writer;       /* [writer_count], one an attempt; owned */
        size_t writer_count;
    } remote;
};

#define STORE_NOTHING_CHANGED (-1) /* in place of a job's id */

/* Schema migrations: step i takes a database from version i to version i + 1. A released step is never edited; every
 * change is a new step. */
extern const char *const schema_steps[];
extern const int schema_version; /* the number of steps */

/* transaction.c. A read holds the mutex; a write also a transaction. store_end commits, or rolls back where `status`
 * is not STATUS_OK; unlocks; and after a commit notifies the subscriber of `changed_job` (0: a scene). */
void store_lock(struct store *store);
void store_unlock(struct store *store);
enum status store_begin(struct store *store, struct error *err);
/* A transaction that frees space or stops work, and therefore works on a full disk; see reserve.c. Where it fails
 * with STATUS_NO_SPACE, the caller repeats it after store_reserve_spend, as long as that returns true. */
enum status store_begin_freeing(struct store *store, struct error *err);
/* Runs the change in one, as often as that takes, so `change` may be called again after it was undone. It says in
 * *changed_job (STORE_NOTHING_CHANGED before) whose subscribers are told. */
typedef enum status store_change(struct store *store, void *what, int64_t *changed_job, struct error *err);
enum status store_change_freeing(struct store *store, store_change *change, void *what, struct error *err);
/* From here on, until store_group_end, all transactions of this thread are one: each of them is still undone alone
 * where it fails, but nothing of any is kept unless the whole is. Other threads wait. Subscribers are told after the
 * whole of the job that the last one has changed. It is one that frees space, as above. */
enum status store_group_begin(struct store *store, struct error *err);
enum status store_group_end(struct store *store, enum status status, struct error *err);
bool store_reserve_spend(struct store *store); /* gives DATA/reserve up; false if that was done already */
enum status store_end(struct store *store, enum status status, int64_t changed_job, struct error *err);

int64_t store_now_ms(void); /* Unix time */

/* When a row may go, as SQL over its table: Unix milliseconds, 0 for never; see retention.h. States
 * up to 2 are those of jobs that have not ended; a scene in state 1 is being checked. A job stays while another that
 * has not ended reads its outputs; kind 1, renders, read nothing of their scene. */
#define JOB_EXPIRES                                                                                                          \
    "(CASE WHEN pinned = 1 OR state <= 2 OR EXISTS (SELECT 1 FROM jobs AS reader WHERE"                                      \
    " reader.source_id = jobs.id AND reader.source_id > 0 AND reader.state <= 2) THEN 0 WHEN expires_ms > 0 THEN expires_ms" \
    " ELSE (SELECT iif(job_ms > 0, finished_ms + job_ms, 0) FROM retention) END)"
#define SCENE_EXPIRES                                                                                                  \
    "(CASE WHEN pinned = 1 OR state = 1 OR EXISTS (SELECT 1 FROM jobs WHERE"                                           \
    " scene_id = scenes.id AND jobs.state <= 2 AND jobs.kind <> 1) THEN 0 WHEN expires_ms > 0 THEN expires_ms"         \
    " ELSE (SELECT iif(scene_ms > 0, scene_ms + max(scenes.created_ms,"                                                \
    " ifnull((SELECT max(created_ms) FROM scene_owners WHERE scene_id = scenes.id), 0),"                               \
    " ifnull((SELECT max(finished_ms) FROM jobs WHERE scene_id = scenes.id), 0)), 0) FROM retention) END)"
#define UPLOAD_EXPIRES                                                                                                 \
    "(CASE WHEN pinned = 1 THEN 0 WHEN expires_ms > 0 THEN expires_ms"                                                 \
    " ELSE updated_ms + (SELECT iif(received = 0 AND scene_id = '', min(empty_upload_ms, upload_ms), upload_ms)"       \
    " FROM retention) END)"
/* Applies a struct retention to a row, in an UPDATE: ?1 pin, ?2 sets_expiry, ?3 expires_ms. */
#define RETENTION_SET                                                                                                  \
    "pinned = CASE ?1 WHEN 0 THEN pinned WHEN 1 THEN 1 ELSE 0 END,"                                                    \
    " expires_ms = iif(?2, ?3, expires_ms)"

/* The part (parts.h) of which the job (an SQL expression) begins an attempt next; null where it cannot at this
 * moment. */
#define NEXT_PART(job)                                                                                                 \
    "(CASE WHEN EXISTS (SELECT 1 FROM parts WHERE job_id = " job " AND parts.state > 1) THEN NULL"                     \
    " WHEN EXISTS (SELECT 1 FROM parts WHERE job_id = " job " AND parts.state = 0) THEN"                               \
    "  (SELECT min(part) FROM parts WHERE job_id = " job " AND parts.state = 0 AND NOT EXISTS (SELECT 1 FROM attempts" \
    "   WHERE attempts.job_id = " job " AND attempts.part = parts.part AND phase = 1))"                                \
    " WHEN EXISTS (SELECT 1 FROM attempts WHERE job_id = " job " AND phase = 1) THEN NULL ELSE 0 END)"

/* users.c, while the store is opened: sets has_users. */
enum status store_load_has_users(struct store *store, struct error *err);

/* reserve.c, under the mutex: after the database was opened; after it was closed. */
enum status reserve_open(struct store *store, const char *dir, struct error *err);
void reserve_close(struct store *store);
/* Before a commit; after it. Space that cannot be had is tried again after the next. */
enum status reserve_before_commit(struct store *store, struct error *err);
void reserve_after_commit(struct store *store);
/* Before an ordinary transaction: STATUS_NO_SPACE while space is tight. */
enum status reserve_check(struct store *store, struct error *err);

/* Inside a transaction: appends an event. */
enum status store_event_append(struct store *store, int64_t job_id, int attempt, const char *type, const char *data,
                               struct error *err);
/* job_inputs.c, all inside a transaction: STATUS_CONFLICT unless job `id` is a reconstruction with results, which
 * another job may read. */
enum status source_check_readable(struct store *store, int64_t id, struct error *err);
/* STATUS_CONFLICT while a job that has not ended reads the outputs of job `id`, which therefore cannot be `action`. */
enum status source_check_unread(struct store *store, int64_t id, const char *action, struct error *err);
/* Adds the names of the job's files, or of those that are still to be sent, with commas between them. */
enum status store_job_files_names(struct store *store, int64_t job_id, bool only_missing, struct buf *names,
                                  struct error *err);
/* STATUS_CONFLICT while files of the job are still to be sent. */
enum status store_job_files_check(struct store *store, int64_t id, struct error *err);
/* Inside a transaction: gives a job a webhook; queues a message to it, if there is one, about a state. */
enum status store_webhook_set(struct store *store, int64_t job_id, const char *url, const char *secret,
                              struct error *err);
enum status store_webhook_post(struct store *store, int64_t job_id, int attempt, const char *state, const char *reason,
                               const char *hint, struct error *err);
struct count_limits; /* limits.h */
/* Inside a transaction: STATUS_LIMIT unless this owner (0: nobody) may queue one more job. */
enum status store_queue_check(struct store *store, int64_t owner_id, const struct count_limits *limits,
                              struct error *err);
/* scene_reading.c, inside a transaction: gives the scene a reading for user owner_id (-1: whom no other's jobs hinder)
 * as store_scene_patch has it; a check that is under way with the same one goes on. */
enum status store_scene_set_reading(struct store *store, const char *id, int64_t owner_id, const char *reading,
                                    struct error *err);
/* Whether the scene is to be read otherwise than a check has read it; `reading` NULL: that does not matter. */
enum status store_scene_is_overtaken(struct store *store, const char *id, const char *reading, int64_t *is_so,
                                     struct error *err);
/* Inside a transaction: STATUS_CONFLICT unless the job runs its attempt `attempt`. */
enum status store_fence(struct store *store, int64_t job_id, int attempt, struct error *err);

/* remote.c, for remote_node.c; inside a transaction, or under the mutex. */
struct remote_row; /* remote.h */
enum status remote_row_read(struct store *store, int64_t job_id, int number, struct remote_row *row, struct error *err);
/* The job waits no more: it shows no reason, and runs from now on. */
enum status remote_tell_begun(struct store *store, int64_t job_id, struct error *err);
/* remote_writers.c, for both; under the mutex: requests that write outputs of an attempt at this moment. */
size_t remote_writer_count(const struct store *store, int64_t job_id, int number);
void remote_writer_add(struct store *store, int64_t job_id, int number);
void remote_writer_drop(struct store *store, int64_t job_id, int number);

#endif
