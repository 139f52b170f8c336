/* files.h -- where the files lie that settings name. */
#ifndef UNBAKE_RELIGHT_FILES_H
#define UNBAKE_RELIGHT_FILES_H

#include "server/relight/relight_job.h"

/* Path of a file that a setting names; the caller's (mem_free). */
char *files_path(const struct relight_job *job, const char *name);

#endif
