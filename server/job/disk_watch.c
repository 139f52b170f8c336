/* disk_watch.c -- see disk_watch.h. */
#include "server/job/disk_watch.h"

#include <stdio.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/log.h"

void disk_watch_init(struct disk_watch *w, uint64_t low_bytes) {
    *w = (struct disk_watch){.low_bytes = low_bytes};
    snprintf(w->reason, sizeof w->reason, DISK_REASON ": less than %llu MiB are free",
             (unsigned long long)(low_bytes >> 20));
}

bool disk_watch_check(struct disk_watch *w, const char *dir) {
    struct error err;
    uint64_t room;
    bool was_low = w->is_low, first = !w->was_seen;
    double now = clock_sec();
    if (!first && now - w->looked_at < DISK_LOOK_SEC)
        return false;
    w->looked_at = now;
    w->was_seen = true;
    if (file_free_bytes(dir, &room, &err) != STATUS_OK) {
        log_warning("%s", err.message);
        return first;
    }
    w->is_low = room < (was_low ? w->low_bytes + w->low_bytes / 4 : w->low_bytes);
    if (w->is_low && !was_low)
        log_warning("%llu MiB are free: jobs wait until there is more room", (unsigned long long)(room >> 20));
    else if (!w->is_low && was_low)
        log_info("%llu MiB are free: jobs go on", (unsigned long long)(room >> 20));
    return first || w->is_low != was_low;
}
