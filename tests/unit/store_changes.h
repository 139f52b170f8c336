/* store_changes.h -- hears of the jobs that change. */
#ifndef UNBAKE_TESTS_UNIT_STORE_CHANGES_H
#define UNBAKE_TESTS_UNIT_STORE_CHANGES_H

#include "tests/unit/store_rig.h"

static int64_t changed_job;
static int changed_count;
static inline void on_change(void *user, int64_t job_id) {
    (void)user;
    changed_job = job_id;
    changed_count++;
}

#endif
