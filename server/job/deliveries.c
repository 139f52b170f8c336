/* deliveries.c -- see deliveries.h. */
#include "server/job/deliveries.h"

#include <math.h>

#include "common/clock.h"

#define USER_DELIVERIES 2 /* of one user at once */
#define RETRY_SEC 5.0     /* after a failure of the store */
#define MIN_SEC 0.05      /* a process whose time is up has been killed, and is given a moment */

/* Lists the users that have as many deliveries under way as one may have; returns their number. */
static size_t busy_users(const struct deliveries *d, int64_t users[DELIVERIES_AT_ONCE]) {
    size_t count = 0;
    for (size_t i = 0; i < DELIVERIES_AT_ONCE; i++) {
        size_t same = 0;
        for (size_t k = 0; k <= i; k++)
            same += d->slot[i].id != 0 && d->slot[k].id != 0 && d->slot[k].owner_id == d->slot[i].owner_id;
        if (same == USER_DELIVERIES)
            users[count++] = d->slot[i].owner_id;
    }
    return count;
}

static bool is_under_way(const struct deliveries *d, int64_t id) {
    for (size_t i = 0; i < DELIVERIES_AT_ONCE; i++)
        if (d->slot[i].id == id)
            return true;
    return false;
}

/* Starts the next message after *after for which its user has a free slot. STATUS_NOT_FOUND: there is none. */
static enum status start_next(struct deliveries *d, struct delivery *slot, const struct scheduler_config *config,
                              struct store *store, int64_t *after, struct error *err) {
    int64_t skip[DELIVERIES_AT_ONCE];
    struct outbox_row row;
    size_t skip_count = busy_users(d, skip);
    enum status status = store_outbox_next(store, *after, skip, skip_count, &row, err);
    if (status != STATUS_OK)
        return status;
    *after = row.id;
    if (!is_under_way(d, row.id))
        status = delivery_start(slot, config, &row, err);
    outbox_row_release(&row);
    return status;
}

enum status deliveries_run(struct deliveries *d, const struct scheduler_config *config, struct store *store,
                           struct error *err) {
    int64_t after = 0;
    double wait = (double)INFINITY;
    bool is_free = false;
    struct error why;
    enum status result = STATUS_OK;
    for (size_t i = 0; i < DELIVERIES_AT_ONCE; i++)
        is_free = delivery_poll(&d->slot[i], store) || is_free;
    /* Asked before the due messages are read, so that none becomes due in between. */
    if (store_outbox_wait(store, &wait, &why) != STATUS_OK)
        wait = RETRY_SEC;
    for (size_t i = 0; i < DELIVERIES_AT_ONCE && is_free; i++) {
        enum status status = STATUS_OK;
        while (d->slot[i].id == 0 && status == STATUS_OK)
            status = start_next(d, &d->slot[i], config, store, &after, &why);
        if (status != STATUS_OK && status != STATUS_NOT_FOUND && result == STATUS_OK)
            result = error_set(err, status, "%s", why.message);
    }
    /* Messages that are due while all slots are busy go out when a delivery ends, which wakes the loop. */
    d->due_at = clock_sec() + wait;
    return result;
}

size_t deliveries_poll(const struct deliveries *d, struct pollfd *fds, double *sleep_sec) {
    double now = clock_sec();
    size_t count = 0;
    *sleep_sec = (double)INFINITY;
    for (size_t i = 0; i < DELIVERIES_AT_ONCE; i++) {
        const struct delivery *one = &d->slot[i];
        double look;
        if (one->has_ended) /* its outcome could not be entered */
            *sleep_sec = fmin(*sleep_sec, RETRY_SEC);
        if (one->has_ended || one->id == 0)
            continue;
        count += run_poll(one->run, fds + count, &look);
        *sleep_sec = fmin(*sleep_sec, fmin(look, fmax(one->kill_at_sec - now, MIN_SEC)));
    }
    return count;
}

void deliveries_stop(struct deliveries *d, struct store *store) {
    for (size_t i = 0; i < DELIVERIES_AT_ONCE; i++)
        delivery_stop(&d->slot[i], store);
}
