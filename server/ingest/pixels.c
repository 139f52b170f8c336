/* pixels.c -- see pixels.h. */
#include "server/ingest/pixels.h"

#include <stdlib.h>

#include "common/machine.h"

#define UNKNOWN_BYTES ((uint64_t)2 << 30) /* where the system does not tell what memory it has */

static void trim(void *user) { spill_trim((struct spill *)user); }

struct spill *pixels_new(const char *dir, const struct spill_limits *limits, struct parallel *pool) {
    struct spill *spill = spill_new(dir, limits);
    parallel_set_between(pool, trim, spill);
    return spill;
}

struct spill *pixels_new_temporary(struct parallel *pool) {
    const char *dir = getenv("TMPDIR");
    uint64_t available = machine_memory_available("");
    const struct spill_limits limits = {.memory_bytes = (available > 0 ? available : UNKNOWN_BYTES) / 2};
    return pixels_new(dir && *dir ? dir : "/var/tmp", &limits, pool);
}

void pixels_free(struct spill *spill, struct parallel *pool) {
    if (!spill)
        return;
    parallel_set_between(pool, NULL, NULL);
    spill_free(spill);
}

void pixels_use(struct spill *spill, struct bundle_limits *limits) {
    limits->spill = spill;
    limits->decode_bytes = spill_memory_bytes(spill) / 2;
}
