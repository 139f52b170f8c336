/* files.h -- where the files lie that settings name. */
#ifndef UNBAKE_RELIGHT_FILES_H
#define UNBAKE_RELIGHT_FILES_H

#include "server/relight/relight_job.h"

/* Path of a file that a setting names; the caller's (mem_free). */
char *files_path(const struct relight_job *job, const char *name);

/* The reconstruction's report.json, or an empty object where it cannot be read; the caller's (cJSON_Delete). */
cJSON *files_report(const struct relight_job *job);

#endif
