/* pixels.c -- see pixels.h. */
#include "server/ingest/pixels.h"

#include <stdlib.h>

#include "common/machine.h"

#define UNKNOWN_BYTES ((uint64_t)2 << 30) /* where the system does not tell what memory it has */

struct spill *pixels_new_temporary(void) {
    const char *dir = getenv("TMPDIR");
    uint64_t available = machine_memory_available("");
    const struct spill_limits limits = {.memory_bytes = (available > 0 ? available : UNKNOWN_BYTES) / 2};
    return spill_new(dir && *dir ? dir : "/var/tmp", &limits);
}

void pixels_use(struct spill *spill, struct bundle_limits *limits) {
    limits->spill = spill;
    limits->decode_bytes = spill_memory_bytes(spill) / 2;
}
