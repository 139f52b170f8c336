/* usage.c -- see usage.h.
 *
 * Between users the one with the least recent CPU time goes first, a second of which counts half
 * after HALF_LIFE_SEC. What is stored is w = log2 of the sum over all charges of
 * seconds * 2^(time / HALF_LIFE_SEC): it does not change while time passes, so users are compared
 * without looking at the clock, and a clock set wrong for a day misjudges a day's work by a factor
 * of two at most. A charge that cannot be entered is kept in
 * memory and entered as soon as it can be. */
#include "server/store/usage.h"

#include <math.h>
#include <string.h>
#include <time.h>

#include "common/mem.h"
#include "server/store/internal.h"

#define HALF_LIFE_SEC 86400.0 /* a day: what was used yesterday counts half */

_Static_assert(sizeof((struct unpaid *)0)->month == USAGE_MONTH_SIZE, "a month");

/* log2(2^a + 2^b) */
static double add_weights(double a, double b) { return fmax(a, b) + log2(1.0 + exp2(-fabs(a - b))); }

/* Keeps a charge for later. The store is locked. */
static void owe(struct store *store, const struct unpaid *u) {
    for (size_t i = 0; i < store->unpaid_count; i++)
        if (store->unpaid[i].owner_id == u->owner_id && strcmp(store->unpaid[i].month, u->month) == 0) {
            store->unpaid[i].weight = add_weights(store->unpaid[i].weight, u->weight);
            store->unpaid[i].cpu_sec += u->cpu_sec;
            return;
        }
    store->unpaid = mem_realloc_array(store->unpaid, store->unpaid_count + 1, sizeof *store->unpaid);
    store->unpaid[store->unpaid_count++] = *u;
}

/* Inside a transaction. */
static enum status pay(struct store *store, const struct unpaid *u, struct error *err) {
    sqlite3_stmt *stmt;
    bool found = false;
    double weight = u->weight;
    enum status status =
        sql_first(&store->sql, &stmt, &found, err, "SELECT weight FROM usage WHERE owner_id = ?", "i", u->owner_id);
    if (found) {
        weight = add_weights(weight, sqlite3_column_double(stmt, 0));
        sqlite3_reset(stmt);
    }
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err, "INSERT OR REPLACE INTO usage (owner_id, weight) VALUES (?, ?)", "id",
                         u->owner_id, weight);
    return status == STATUS_OK
               ? sql_run(&store->sql, err,
                         "INSERT INTO usage_months (owner_id, month, cpu_sec) VALUES (?, ?, ?)"
                         " ON CONFLICT (owner_id, month) DO UPDATE SET cpu_sec = cpu_sec + excluded.cpu_sec",
                         "itd", u->owner_id, u->month, u->cpu_sec)
               : status;
}

enum status store_usage_pay(struct store *store, struct error *err) {
    store_lock(store);
    bool is_none = store->unpaid_count == 0;
    store_unlock(store);
    enum status status = is_none ? STATUS_OK : store_begin(store, err);
    if (is_none || status != STATUS_OK)
        return status;
    size_t count = store->unpaid_count; /* 0 where another thread has paid meanwhile */
    struct unpaid *unpaid = store->unpaid;
    store->unpaid = NULL;
    store->unpaid_count = 0;
    for (size_t i = 0; i < count && status == STATUS_OK; i++)
        status = pay(store, &unpaid[i], err);
    status = store_end(store, status, STORE_NOTHING_CHANGED, err);
    store_lock(store);
    for (size_t i = 0; i < count && status != STATUS_OK; i++)
        owe(store, &unpaid[i]);
    store_unlock(store);
    mem_free(unpaid);
    return status;
}

enum status store_usage_add(struct store *store, int64_t owner_id, double cpu_sec, struct error *err) {
    if (!(cpu_sec > 0.0))
        return STATUS_OK;
    int64_t now_ms = store_now_ms();
    time_t now = (time_t)(now_ms / 1000);
    struct tm utc;
    struct unpaid u = {
        .owner_id = owner_id, .weight = log2(cpu_sec) + (double)now_ms * 1e-3 / HALF_LIFE_SEC, .cpu_sec = cpu_sec};
    gmtime_r(&now, &utc);
    strftime(u.month, sizeof u.month, "%Y-%m", &utc);
    store_lock(store);
    owe(store, &u);
    store_unlock(store);
    return store_usage_pay(store, err);
}

enum status store_usage_list(struct store *store, struct usage_row **rows, size_t *count, struct error *err) {
    sqlite3_stmt *stmt;
    *rows = NULL;
    *count = 0;
    store_lock(store);
    enum status status = sql_query(&store->sql, &stmt, err,
                                   "SELECT ifnull(users.name, ''), month, cpu_sec FROM usage_months"
                                   " LEFT JOIN users ON users.id = owner_id ORDER BY month, 1, owner_id",
                                   "");
    while (sql_next(&store->sql, stmt, &status, err)) {
        *rows = mem_realloc_array(*rows, *count + 1, sizeof **rows);
        struct usage_row *added = &(*rows)[(*count)++];
        *added = (struct usage_row){.user = sql_dup(stmt, 0), .cpu_sec = sqlite3_column_double(stmt, 2)};
        strncpy(added->month, sql_text(stmt, 1), sizeof added->month - 1);
    }
    store_unlock(store);
    if (status != STATUS_OK) {
        store_usage_release(*rows, *count);
        *rows = NULL;
        *count = 0;
    }
    return status;
}

void store_usage_release(struct usage_row *rows, size_t count) {
    for (size_t i = 0; i < count; i++)
        mem_free(rows[i].user);
    mem_free(rows);
}
