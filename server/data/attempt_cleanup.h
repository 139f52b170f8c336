/* attempt_cleanup.h -- removes what attempts have left that nobody sees: outputs of which no row of state.db says that
 * the attempt has them, and folders that hold neither outputs nor a checkpoint. */
#ifndef UNBAKE_DATA_ATTEMPT_CLEANUP_H
#define UNBAKE_DATA_ATTEMPT_CLEANUP_H

#include <stdint.h>

#include "common/error.h"
#include "server/store/store.h"

/* Of all attempts of the job; of those that run, by the store, nothing: but for `ended` (0: none), whose end is still
 * to be entered. */
enum status attempt_cleanup(const char *data_dir, struct store *store, int64_t job_id, int ended, struct error *err);

#endif
