/* reconcile.c -- at the start of a daemon: attempts that an earlier one has left running, and nobody takes up, end. See
 * attempts.h. */
#include "server/store/attempts.h"
#include "server/store/transition.h"

struct strays {
    const struct attempt_key *kept; /* [count] */
    size_t count;
    int64_t last; /* that was queued again; 0: none yet */
    int64_t next; /* that is; 0: there is no more */
};

static bool keeps_job(const struct strays *s, int64_t id) {
    bool keeps = false;
    for (size_t i = 0; i < s->count && !keeps; i++)
        keeps = s->kept[i].job_id == id;
    return keeps;
}

static bool keeps_attempt(const struct strays *s, int64_t id, int64_t number) {
    bool keeps = false;
    for (size_t i = 0; i < s->count && !keeps; i++)
        keeps = s->kept[i].job_id == id && s->kept[i].number == number;
    return keeps;
}

/* Inside a transaction: the first running job behind the last one of which no attempt is kept; *id 0: there is none. */
static enum status find_stray(struct store *store, const struct strays *s, int64_t *id, struct error *err) {
    enum status status;
    for (int64_t after = s->last;; after = *id) {
        status = sql_int(&store->sql, 0, id, err, "SELECT min(id) FROM jobs WHERE state = ? AND id > ?", "ni",
                         (int)JOB_RUNNING, after);
        if (status != STATUS_OK || *id == 0 || !keeps_job(s, *id))
            return status;
    }
}

/* Inside a transaction: ends the job's attempts that are not kept, of which another is. */
static enum status end_strays(struct store *store, const struct strays *s, int64_t id, struct error *err) {
    struct present now;
    int64_t number = 0;
    enum status status = transition_read(store, id, &now, err);
    now.ending = ENDING_RESTARTED;
    while (status == STATUS_OK) {
        status = sql_int(&store->sql, 0, &number, err,
                         "SELECT min(number) FROM attempts WHERE job_id = ? AND phase = ? AND number > ?", "inn", id,
                         (int)ATTEMPT_ROW_RUNNING, (int)number);
        now.attempt = (int)number;
        if (status != STATUS_OK || number == 0)
            break;
        if (!keeps_attempt(s, id, number))
            status = attempt_end_one(store, &now, err);
    }
    return status;
}

static enum status end_all_strays(struct store *store, void *what, int64_t *changed_job, struct error *err) {
    const struct strays *s = what;
    enum status status = STATUS_OK;
    (void)changed_job; /* the jobs run on */
    for (size_t i = 0; i < s->count && status == STATUS_OK; i++)
        status = end_strays(store, s, s->kept[i].job_id, err);
    return status;
}

static enum status requeue_one(struct store *store, int64_t id, struct error *err) {
    struct present now;
    enum status status = transition_read(store, id, &now, err);
    now.ending = ENDING_RESTARTED;
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err, "UPDATE jobs SET disk_bytes = -1 WHERE id = ?", "i", id);
    return status == STATUS_OK ? transition_move(store, &now, JOB_QUEUED, "the daemon was restarted", "", err) : status;
}

/* One job in each transaction: where the disk is full, those before are queued all the same. */
static enum status requeue_next(struct store *store, void *what, int64_t *changed_job, struct error *err) {
    struct strays *s = what;
    enum status status = find_stray(store, s, &s->next, err);
    if (status != STATUS_OK || s->next == 0)
        return status;
    *changed_job = s->next;
    return requeue_one(store, s->next, err);
}

enum status store_reconcile(struct store *store, const struct attempt_key *kept, size_t kept_count, size_t *requeued,
                            struct error *err) {
    struct strays s = {.kept = kept, .count = kept_count};
    enum status status = kept_count > 0 ? store_change_freeing(store, end_all_strays, &s, err) : STATUS_OK;
    *requeued = 0;
    while (status == STATUS_OK) {
        status = store_change_freeing(store, requeue_next, &s, err);
        if (s.next == 0)
            break;
        s.last = s.next;
        *requeued += status == STATUS_OK;
    }
    return status;
}
