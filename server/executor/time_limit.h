/* time_limit.h -- attempts that a site ends because their time is up. Those go on elsewhere from their checkpoints,
 * uncharged, as often as it takes. One that has not saved anything in its whole time would do so for ever. */
#ifndef UNBAKE_EXECUTOR_TIME_LIMIT_H
#define UNBAKE_EXECUTOR_TIME_LIMIT_H

#include <stdbool.h>

#include "server/executor/site.h"
#include "server/store/remote.h"

/* Whether the attempt, which was taken from its node, has run for about time_min without a checkpoint, or a picture,
 * that came here. */
bool time_limit_is_futile(const struct site *site, const char *data_dir, const struct remote_row *row);

#endif
