/* collector.h -- removes what has expired (store/retention.h), and sees to what is left to be done
 * about uploads, once in a while. */
#ifndef UNBAKE_DATA_COLLECTOR_H
#define UNBAKE_DATA_COLLECTOR_H

#include "common/error.h"
#include "common/json.h"
#include "server/http/api.h"

struct collector; /* its thread; opaque */

/* Starts the thread, which collects at once and then every interval_sec; *c is to be stopped. */
enum status collector_start(struct collector **c, struct api *api, double interval_sec,
                            struct error *err);
void collector_stop(struct collector *c); /* NULL is fine */

/* Removes what has expired by now, or only says what would go. Each is appended to the array
 * `items` ({kind, id, name, expires_at, files, bytes}) unless that is NULL. What cannot be removed
 * is logged and left for the next time. */
enum status collector_run(struct api *api, bool dry_run, cJSON *items, struct error *err);

#endif
