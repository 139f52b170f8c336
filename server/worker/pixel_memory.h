/* pixel_memory.h -- how much memory a worker uses for pixels of photographs; what is beyond it lies on the disk. */
#ifndef UNBAKE_WORKER_PIXEL_MEMORY_H
#define UNBAKE_WORKER_PIXEL_MEMORY_H

#include <stdint.h>

#include "common/spill.h"
#include "server/worker/order.h"

/* Bytes: as the order says; else half of what the worker may use or, without a limit, could have now. Half of that
 * again for each time that the job has run out of memory. */
uint64_t pixel_memory_bytes(const struct order *order);

/* Memory and a file in the order's folder; the caller's (spill_free). */
struct spill *pixel_memory_new(const struct order *order);

#endif
