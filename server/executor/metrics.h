/* metrics.h -- figures of executors for /metrics. */
#ifndef UNBAKE_EXECUTOR_METRICS_H
#define UNBAKE_EXECUTOR_METRICS_H

#include "common/buf.h"

/* `sites` is a struct sites that has been started; its labels are the names of executors. Any thread. */
void executor_metrics(const void *sites, struct buf *b);

#endif
