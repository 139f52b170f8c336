/* test_time_limit.c -- an attempt whose site's time was up: futile only where nothing was saved since it was
 * claimed. */
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "common/output_names.h"
#include "server/data/layout.h"
#include "server/data/picture_record.h"
#include "server/executor/time_limit.h"
#include "tests/check.h"

#define CLAIMED_MS 1700000000000

int main(void) {
    static char dir[] = "/tmp/unbake-test-limit-XXXXXX";
    struct error err;
    CHECK(mkdtemp(dir));
    const struct site hour = {.time_min = 60.0}, minutes = {.time_min = 4.0};
    struct remote_row row = {.job_id = 3, .number = 2, .claimed_ms = CLAIMED_MS, .heard_ms = CLAIMED_MS + 57 * 60000};
    char *attempt = layout_attempt(dir, 3, 2), *folder = layout_checkpoint_folder(attempt),
         *part = layout_part(folder, 7);
    CHECK(!time_limit_is_futile(&hour, dir, &row)); /* nothing is known of what it has saved */
    CHECK(file_make_dirs(folder, &err) == STATUS_OK);
    CHECK(time_limit_is_futile(&hour, dir, &row));
    row.heard_ms = CLAIMED_MS + 30 * 60000; /* others wanted its place */
    CHECK(!time_limit_is_futile(&hour, dir, &row));
    row.heard_ms = CLAIMED_MS + 60000;
    CHECK(!time_limit_is_futile(&minutes, dir, &row));
    row.heard_ms = CLAIMED_MS + 121000;
    CHECK(time_limit_is_futile(&minutes, dir, &row));
    /* A checkpoint of the attempt before, then one of its own. */
    struct timespec times[2] = {{.tv_sec = CLAIMED_MS / 1000 - 10}, {.tv_sec = CLAIMED_MS / 1000 - 10}};
    CHECK(file_replace(part, "x", 1, &err) == STATUS_OK && utimensat(AT_FDCWD, part, times, 0) == 0);
    CHECK(time_limit_is_futile(&minutes, dir, &row));
    times[1].tv_sec = CLAIMED_MS / 1000 + 100;
    CHECK(utimensat(AT_FDCWD, part, times, 0) == 0);
    CHECK(!time_limit_is_futile(&minutes, dir, &row));
    CHECK(unlink(part) == 0 && time_limit_is_futile(&minutes, dir, &row));
    char *out = layout_out(attempt), *record = layout_output(attempt, OUTPUT_RECORD); /* a render's pictures */
    CHECK(file_make_dirs(out, &err) == STATUS_OK && file_replace(record, "x", 1, &err) == STATUS_OK);
    CHECK(!time_limit_is_futile(&minutes, dir, &row));
    mem_free(record);
    mem_free(out);
    row.claimed_ms = 0; /* it never began */
    CHECK(!time_limit_is_futile(&minutes, dir, &row));
    CHECK(file_remove_tree(dir, &err) == STATUS_OK);
    mem_free(part);
    mem_free(folder);
    mem_free(attempt);
    return check_result();
}
