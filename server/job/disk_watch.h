/* disk_watch.h -- whether the disk of the data folder is so full that work must wait.
 *
 *      enough ──(less than low_bytes free)──> low ──(a quarter more than that free)──> enough
 */
#ifndef UNBAKE_JOB_DISK_WATCH_H
#define UNBAKE_JOB_DISK_WATCH_H

#include <stdbool.h>
#include <stdint.h>

#define DISK_LOOK_SEC 2.0 /* between two measurements */

struct disk_watch {
    uint64_t low_bytes; /* 0: never low */
    bool is_low;
    bool was_seen;    /* has been measured once */
    double looked_at; /* as clock_sec */
    char reason[128]; /* for jobs that wait; depends on low_bytes only */
};

#define DISK_REASON "the disk is nearly full" /* the beginning of every such reason */
#define DISK_HINT "It goes on by itself when there is room: delete jobs or scenes that nobody needs."

void disk_watch_init(struct disk_watch *w, uint64_t low_bytes);
/* Measures at most every DISK_LOOK_SEC. True when is_low has changed, and the first time. */
bool disk_watch_check(struct disk_watch *w, const char *dir);

#endif
