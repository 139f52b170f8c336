/* tasks.h -- the kinds of work that a worker does. */
#ifndef UNBAKE_WORKER_TASKS_H
#define UNBAKE_WORKER_TASKS_H

#include "common/error.h"
#include "server/worker/order.h"
#include "server/worker/progress.h"

/* Unpacks DIR/archive to DIR/files and reads all of it; reports every problem. */
enum status task_check(const struct order *order, struct progress *progress, struct error *err);

/* Reconstructs from the newest checkpoint on; leaves the outputs in DIR/out. STATUS_CANCELLED when asked to stop (a
 * checkpoint was saved). */
enum status task_reconstruct(const struct order *order, struct progress *progress, struct error *err);

/* Renders a reconstruction under the light that the settings give it (relight/relight.h), a view after the other into
 * DIR/out. Views that an earlier attempt has finished lie there already and are kept. STATUS_CANCELLED when asked to
 * stop. */
enum status task_render(const struct order *order, struct progress *progress, struct error *err);

/* Compares a reconstruction with the truth of its room: DIR/out/evaluation.json and pictures/. */
enum status task_evaluate(const struct order *order, struct progress *progress, struct error *err);

/* Calls a webhook; see deliver.h. */
enum status task_deliver(const struct order *order, struct progress *progress, struct error *err);

#endif
