/* collector.h -- periodically removes what has expired (store/retention.h) and maintains unfinished uploads; at
 * start, removes files without a row. */
#ifndef UNBAKE_DATA_COLLECTOR_H
#define UNBAKE_DATA_COLLECTOR_H

#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"
#include "server/data/folder.h"
#include "server/store/store.h"

struct collector_config { /* pointers are borrowed */
    struct store *store;
    struct folder *folder;
    /* Called with `uploads`: repairs interrupted uploads; removes those whose row is gone. */
    void (*maintain_uploads)(void *uploads);
    enum status (*forget_upload)(void *uploads, const char *id, struct error *err);
    void *uploads;
};

/* Removes the files and folders that the store has no row for. Call at start, before others add to them. */
enum status collector_sweep(struct store *store, struct folder *folder, struct error *err);

/* Removes what has expired by now; a dry run only finds it. `found`, unless NULL, is called for each, with its disk
 * usage. What cannot be removed is logged and left for the next run. */
enum status collector_run(const struct collector_config *config, bool dry_run,
                          void (*found)(void *user, const struct expired *e, uint64_t files, uint64_t bytes),
                          void *user, struct error *err);
const char *collector_kind_name(const struct expired *e); /* "upload", "job" or "scene" */

struct collector; /* its thread; opaque */

/* Starts the thread, which collects at once and then every interval_sec. End it with collector_stop. */
enum status collector_start(struct collector **c, const struct collector_config *config, double interval_sec,
                            struct error *err);
void collector_stop(struct collector *c); /* NULL is allowed */

#endif
