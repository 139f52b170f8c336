/* setting_files.h -- where the files lie that settings name. */
#ifndef UNBAKE_RELIGHT_SETTING_FILES_H
#define UNBAKE_RELIGHT_SETTING_FILES_H

#include "server/relight/relight_job.h"

/* Path of a file that a setting names; the caller's (mem_free). */
char *setting_files_path(const struct relight_job *job, const char *name);

/* The reconstruction's report.json, or an empty object where it cannot be read; the caller's (cJSON_Delete). */
cJSON *setting_files_report(const struct relight_job *job);

#endif
