/* test_disk_watch.c -- when the disk counts as nearly full, and when no more: not by the same figure, lest jobs stop
 * and go on all the time. */
#include "server/job/disk_watch.h"

#include <errno.h>
#include <sys/statvfs.h>

#include "common/log.h"
#include "tests/check.h"

#define MIB ((uint64_t)1 << 20)
#define LOW (800 * MIB)

static uint64_t room; /* free bytes of every disk */
static int fault;

int statvfs(const char *path, struct statvfs *info) {
    (void)path;
    *info = (struct statvfs){
        .f_bsize = 4096, .f_frsize = 4096, .f_blocks = UINT32_MAX, .f_bfree = room / 4096, .f_bavail = room / 4096};
    errno = fault;
    return fault ? -1 : 0;
}

static struct disk_watch watch;

/* Looks now, with so much room. */
static bool look(uint64_t bytes) {
    room = bytes;
    watch.looked_at = -1e9;
    return disk_watch_check(&watch, "/");
}

int main(void) {
    log_set_level(LOG_ERROR);
    disk_watch_init(&watch, LOW);
    CHECK(look(900 * MIB) && !watch.is_low); /* the first look is told */
    CHECK(!look(LOW) && !watch.is_low);
    CHECK(look(LOW - MIB) && watch.is_low);
    /* A quarter more than what made it low. */
    CHECK(!look(LOW) && watch.is_low);
    CHECK(!look(LOW + LOW / 4 - MIB) && watch.is_low);
    fault = EIO;
    CHECK(!look(2 * LOW) && watch.is_low); /* a disk that does not tell changes nothing */
    fault = 0;
    CHECK(look(LOW + LOW / 4) && !watch.is_low);
    CHECK(!look(LOW) && !watch.is_low);
    CHECK(look(0) && watch.is_low);
    /* Not before its time. */
    room = 2 * LOW;
    CHECK(!disk_watch_check(&watch, "/") && watch.is_low);

    disk_watch_init(&watch, 0);
    CHECK(look(0) && !watch.is_low); /* 0: never */
    return check_result();
}
