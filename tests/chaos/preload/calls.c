/* calls.c -- preloaded into the daemon: its n-th call of SQLite (UNBAKE_FAULTS_OF=sql) or of the system fails, once;
 * see sql_faults.h and system_faults.h. The page of faults.h says which, and by what error (0: of the system, EIO or
 * ENOSPC in turn), and hears whether there was one. */
#include <stdlib.h>

#include "tests/chaos/faults.h"
#include "tests/system_faults.h"

static struct faults *faults;
static bool is_sql;

__attribute__((constructor)) static void begin(void) {
    const char *path = getenv("UNBAKE_FAULTS"), *of = getenv("UNBAKE_FAULTS_OF");
    faults_are_off = true;
    faults = path ? faults_map(path) : NULL;
    faults_are_off = false;
    is_sql = of && strcmp(of, "sql") == 0;
    if (!faults)
        return;
    if (is_sql)
        sql_faults_arm(atomic_load(&faults->fail_at));
    else
        system_faults_arm(atomic_load(&faults->fail_at));
    if (atomic_load(&faults->error))
        system_fault = atomic_load(&faults->error);
}

__attribute__((destructor)) static void end(void) {
    if (!faults || !(is_sql ? sql_faults_lift() : system_faults_lift()))
        return;
    snprintf(faults->what, sizeof faults->what, "%s", is_sql ? "SQLite" : system_failed);
    atomic_fetch_add(&faults->failed, 1);
}
