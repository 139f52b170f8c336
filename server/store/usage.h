/* usage.h -- CPU time that users' jobs have taken: of late, for their turns (turns.c), and by months, for those who
 * account for it. As for all of the store, see store.h. */
#ifndef UNBAKE_STORE_USAGE_H
#define UNBAKE_STORE_USAGE_H

#include <stddef.h>
#include <stdint.h>

#include "common/error.h"

struct store; /* store.h */

#define USAGE_MONTH_SIZE 8 /* "2026-01", UTC, and the NUL */

/* Charges CPU time to a user (0: nobody), in the present month. Where that fails, the charge is kept in memory;
 * store_usage_pay and the next charge enter it. */
enum status store_usage_add(struct store *store, int64_t owner_id, double cpu_sec, struct error *err);
enum status store_usage_pay(struct store *store, struct error *err);

struct usage_row {
    char *user; /* "" for nobody; owned */
    char month[USAGE_MONTH_SIZE];
    double cpu_sec;
};
/* Every month of every user in which something was charged, month by month. *rows is the caller's
 * (store_usage_release). */
enum status store_usage_list(struct store *store, struct usage_row **rows, size_t *count, struct error *err);
void store_usage_release(struct usage_row *rows, size_t count);

#endif
