/* reconcile.c -- at the start of a daemon: attempts that an earlier one has left running, and nobody takes up, end. See
 * attempts.h. */
#include "server/store/attempts.h"
#include "server/store/transition.h"

static bool keeps_job(const struct attempt_key *kept, size_t count, int64_t id) {
    bool keeps = false;
    for (size_t i = 0; i < count && !keeps; i++)
        keeps = kept[i].job_id == id;
    return keeps;
}

/* Inside a transaction: the first running job behind `after` of which no attempt is kept; *id 0: there is none. */
static enum status find_stray(struct store *store, const struct attempt_key *kept, size_t kept_count, int64_t after,
                              int64_t *id, struct error *err) {
    enum status status;
    for (;; after = *id) {
        status = sql_int(&store->sql, 0, id, err, "SELECT min(id) FROM jobs WHERE state = ? AND id > ?", "ni",
                         (int)JOB_RUNNING, after);
        if (status != STATUS_OK || *id == 0 || !keeps_job(kept, kept_count, *id))
            return status;
    }
}

/* Inside a transaction: ends the job's attempts that are not kept, of which another is. */
static enum status end_strays(struct store *store, const struct attempt_key *kept, size_t kept_count, int64_t id,
                              struct error *err) {
    struct present now;
    int64_t number = 0;
    enum status status = transition_look(store, id, &now, err);
    now.ending = ENDING_RESTARTED;
    while (status == STATUS_OK) {
        status = sql_int(&store->sql, 0, &number, err,
                         "SELECT min(number) FROM attempts WHERE job_id = ? AND phase = ? AND number > ?", "inn", id,
                         (int)ATTEMPT_ROW_RUNNING, (int)number);
        bool is_kept = false;
        for (size_t i = 0; i < kept_count; i++)
            is_kept |= kept[i].job_id == id && kept[i].number == number;
        now.attempt = (int)number;
        if (status != STATUS_OK || number == 0)
            break;
        if (!is_kept)
            status = attempt_end_one(store, &now, err);
    }
    return status;
}

static enum status requeue_one(struct store *store, int64_t id, struct error *err) {
    struct present now;
    enum status status = transition_look(store, id, &now, err);
    now.ending = ENDING_RESTARTED;
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err, "UPDATE jobs SET disk_bytes = -1 WHERE id = ?", "i", id);
    return status == STATUS_OK ? transition_move(store, &now, JOB_QUEUED, "the daemon was restarted", "", err) : status;
}

static enum status end_all_strays(struct store *store, const struct attempt_key *kept, size_t kept_count,
                                  struct error *err) {
    enum status status;
    do {
        status = store_begin_freeing(store, err);
        if (status != STATUS_OK)
            return status;
        for (size_t i = 0; i < kept_count && status == STATUS_OK; i++)
            status = end_strays(store, kept, kept_count, kept[i].job_id, err);
        status = store_end(store, status, STORE_NOTHING_CHANGED, err);
    } while (status == STATUS_NO_SPACE && store_reserve_spend(store));
    return status;
}

enum status store_reconcile(struct store *store, const struct attempt_key *kept, size_t kept_count, size_t *requeued,
                            struct error *err) {
    int64_t id = 0, after = 0;
    *requeued = 0;
    enum status ended = kept_count > 0 ? end_all_strays(store, kept, kept_count, err) : STATUS_OK;
    if (ended != STATUS_OK)
        return ended;
    for (;;) {
        enum status status = store_begin_freeing(store, err);
        if (status != STATUS_OK)
            return status;
        status = find_stray(store, kept, kept_count, after, &id, err);
        if (status == STATUS_OK && id)
            status = requeue_one(store, id, err);
        status = store_end(store, status, id ? id : STORE_NOTHING_CHANGED, err);
        if (status == STATUS_NO_SPACE && store_reserve_spend(store))
            continue;
        if (status != STATUS_OK || id == 0)
            return status;
        after = id;
        ++*requeued;
    }
}
