/* transaction.c -- the store's clock, its mutex, and transactions under it; see internal.h. */
#include <time.h>

#include "server/store/internal.h"

int64_t store_now_ms(void) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

void store_lock(struct store *store) { pthread_mutex_lock(&store->mutex); }

void store_unlock(struct store *store) { pthread_mutex_unlock(&store->mutex); }

static enum status begin(struct store *store, bool is_freeing, struct error *err) {
    store_lock(store);
    enum status status = is_freeing ? STATUS_OK : reserve_check(store, err);
    if (status == STATUS_OK)
        status = sql_begin(&store->sql, err);
    if (status != STATUS_OK)
        store_unlock(store);
    return status;
}

enum status store_begin(struct store *store, struct error *err) { return begin(store, false, err); }

enum status store_begin_freeing(struct store *store, struct error *err) { return begin(store, true, err); }

enum status store_end(struct store *store, enum status status, int64_t changed_job, struct error *err) {
    if (status == STATUS_OK)
        status = reserve_look(store, err);
    status = sql_end(&store->sql, status, err);
    if (status == STATUS_OK)
        reserve_keep(store);
    store_unlock(store);
    if (status == STATUS_OK && changed_job != STORE_NOTHING_CHANGED && store->changed)
        store->changed(store->changed_user, changed_job);
    return status;
}
