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

/* Begins a transaction; within a group, a part of it. After some errors SQLite has rolled back all by itself: then the
 * group is lost, and nothing more may be entered for it. */
static enum status begin_sql(struct store *store, struct error *err) {
    if (!store->group.is_open)
        return sql_begin(&store->sql, err);
    return sqlite3_get_autocommit(store->sql.db)
               ? error_set(err, STATUS_IO, "%s: what belongs together could not be entered", store->sql.path)
               : sql_run(&store->sql, err, "SAVEPOINT part", "");
}

static enum status end_sql(struct store *store, enum status status, struct error *err) {
    if (!store->group.is_open)
        return sql_end(&store->sql, status, err);
    if (sqlite3_get_autocommit(store->sql.db))
        return status == STATUS_OK ? error_set(err, STATUS_IO, "%s: rolled back", store->sql.path) : status;
    if (status != STATUS_OK)
        (void)sql_run(&store->sql, NULL, "ROLLBACK TO part", "");
    enum status released = sql_run(&store->sql, status == STATUS_OK ? err : NULL, "RELEASE part", "");
    return status == STATUS_OK ? released : status;
}

static enum status begin(struct store *store, bool is_freeing, struct error *err) {
    store_lock(store);
    enum status status = is_freeing ? STATUS_OK : reserve_check(store, err);
    if (status == STATUS_OK)
        status = begin_sql(store, err);
    if (status != STATUS_OK)
        store_unlock(store);
    return status;
}

enum status store_begin(struct store *store, struct error *err) { return begin(store, false, err); }

enum status store_begin_freeing(struct store *store, struct error *err) { return begin(store, true, err); }

enum status store_end(struct store *store, enum status status, int64_t changed_job, struct error *err) {
    bool is_part = store->group.is_open;
    if (status == STATUS_OK)
        status = reserve_before_commit(store, err);
    status = end_sql(store, status, err);
    if (status == STATUS_OK && is_part && changed_job != STORE_NOTHING_CHANGED)
        store->group.changed = changed_job;
    if (status == STATUS_OK && !is_part)
        reserve_after_commit(store);
    store_unlock(store);
    if (status == STATUS_OK && !is_part && changed_job != STORE_NOTHING_CHANGED && store->changed)
        store->changed(store->changed_user, changed_job);
    return status;
}

enum status store_change_freeing(struct store *store, store_change *change, void *what, struct error *err) {
    enum status status;
    do {
        int64_t changed_job = STORE_NOTHING_CHANGED;
        status = store_begin_freeing(store, err);
        if (status != STATUS_OK)
            return status;
        status = change(store, what, &changed_job, err);
        status = store_end(store, status, changed_job, err);
    } while (status == STATUS_NO_SPACE && store_reserve_spend(store));
    return status;
}

enum status store_group_begin(struct store *store, struct error *err) {
    enum status status = store_begin_freeing(store, err);
    if (status == STATUS_OK)
        store->group = (struct group){.is_open = true, .changed = STORE_NOTHING_CHANGED};
    return status;
}

enum status store_group_end(struct store *store, enum status status, struct error *err) {
    store->group.is_open = false;
    if (status == STATUS_OK && sqlite3_get_autocommit(store->sql.db))
        status = error_set(err, STATUS_IO, "%s: rolled back", store->sql.path);
    return store_end(store, status, store->group.changed, err);
}
