/* pixel_memory.c -- see pixel_memory.h. */
#include "server/worker/pixel_memory.h"

#include "common/machine.h"

/* With less, even one photograph is read from the disk again and again: one of 12 megapixels with what is found of it
 * takes 150 MB. Moves time only. */
#define MIN_BYTES ((uint64_t)64 << 20)
/* Where the system does not tell what it has. */
#define UNKNOWN_BYTES ((uint64_t)2 << 30)
#define STEPS_MAX 16 /* halvings of the share */

uint64_t pixel_memory_bytes(const struct order *order) {
    uint64_t bytes = order->photograph_memory_bytes;
    if (bytes == 0) {
        uint64_t available = machine_memory_available("");
        if (available == 0)
            available = UNKNOWN_BYTES;
        if (order->memory_bytes > 0 && order->memory_bytes < available)
            available = order->memory_bytes;
        bytes = available / 2;
    }
    bytes >>= order->memory_step < STEPS_MAX ? order->memory_step : STEPS_MAX;
    return bytes > MIN_BYTES || order->photograph_memory_bytes > 0 ? bytes : MIN_BYTES;
}

struct spill *pixel_memory_new(const struct order *order) {
    const struct spill_limits limits = {
        .memory_bytes = pixel_memory_bytes(order),
        .keep_free_bytes = order->keep_free_bytes,
        .file_bytes = order->disk_bytes,
    };
    return spill_new(order->dir, &limits);
}
